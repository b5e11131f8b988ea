# Tables and the report, from the metrics files of jobs.


SWEEP = CONFIG.sweep.name if CONFIG.sweep.variants else None
TABLES = [SWEEP] if SWEEP else ["fitting", "datasets", "rendering", "model_size", "edits"]


rule tables:
    input:
        done("volume", "views", "surfels", "shading", "texture"),
        done("pse", "timing") if SWEEP is None else [],
    output:
        collect("<results>/tables/{name}.{format}", name=TABLES, format=("csv", "md", "tex")),
    log:
        f"<logs>/tables-{TABLES[0]}.log",
    params:
        code=code_digest("texgs.cli.tables"),
        folder=subpath(output[0], parent=True),
        sweep=f"--sweep {shlex.quote(SWEEP)}" if SWEEP else "",
    shell:
        "texgs tables {input:q} {params.sweep} --output {params.folder:q} 2>&1 | tee {log:q}"


rule report:
    input:
        done(*STAGES),
    output:
        "<results>/report.html",
    log:
        "<logs>/report.log",
    params:
        code=code_digest("texgs.cli.report"),
        template=digest(files("texgs.report").joinpath("report.html.j2").read_text()),
    shell:
        "texgs report {input:q} --output {output:q} 2>&1 | tee {log:q}"
