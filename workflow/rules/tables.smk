# Tables and the report, from the metrics files of jobs.


from texgs.report import tables

SWEEPS = sorted(filter(None, PLAN.sweeps))
TABLES = list(tables.TABLES) if "" in PLAN.sweeps else []
OF_SWEEPS = ("phase", "edit", "edit_metrics")  # places that their tables read


rule tables:
    input:
        PLAN.done("volume", "views", "phase", "mesh", "pse", "timing", "edit", "edit_metrics"),
    output:
        collect("<results>/tables/{name}.{format}", name=TABLES, format=("csv", "md", "tex")),
    log:
        "<logs>/tables.log",
    params:
        code=PLAN.code["texgs.cli.tables"],
        folder=subpath(output[0], parent=True),
    shell:
        "texgs tables {input:q} --output {params.folder:q} 2>&1 | tee --append {log:q}"


rule sweep:
    input:
        lambda wildcards: PLAN.done(*OF_SWEEPS, sweep=wildcards.sweep),
    output:
        collect("<results>/tables/sweep-{{sweep}}.{format}", format=("csv", "md", "tex")),
    log:
        "<logs>/tables-{sweep}.log",
    params:
        code=PLAN.code["texgs.cli.tables"],
        folder=subpath(output[0], parent=True),
    shell:
        "texgs tables {input:q} --sweep {wildcards.sweep:q} --output {params.folder:q} 2>&1 | tee --append {log:q}"


rule report:
    input:
        sorted(
            {*PLAN.done(*PLACES), *(file for name in SWEEPS for file in PLAN.done(*OF_SWEEPS, sweep=name))}
        ),
    output:
        "<results>/report.html",
    log:
        "<logs>/report.log",
    params:
        code=PLAN.code["texgs.cli.report"],
        template=digest(files("texgs.report").joinpath("report.html.j2").read_text()),
    shell:
        "texgs report {input:q} --output {output:q} 2>&1 | tee --append {log:q}"
