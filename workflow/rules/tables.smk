# Tables, from the metrics files of jobs.


SWEEP = CONFIG.sweep.name if CONFIG.sweep.variants else None
TABLE = SWEEP or "fitting"


rule tables:
    input:
        done("surfels", "shading", "texture"),
    output:
        collect("<results>/tables/{name}.{format}", name=TABLE, format=("csv", "md", "tex")),
    log:
        f"<logs>/tables-{TABLE}.log",
    params:
        code=code_digest("texgs.cli.tables"),
        folder=subpath(output[0], parent=True),
        sweep=f"--sweep {shlex.quote(SWEEP)}" if SWEEP else "",
    shell:
        "texgs tables {input:q} {params.sweep} --output {params.folder:q} 2>&1 | tee {log:q}"
