# Tables and the report, from the metrics files of jobs.


rule tables:
    input:
        metrics=PLAN.metrics_shown(*{place for table in TABLES for place in table.places}),
        note=PLAN.notes["tables"],
    output:
        f"<results>/tables/{DOCUMENT}",
        collect("<results>/tables/{table}.{format}", table=[table.name for table in TABLES], format=FORMATS),
    log:
        "<logs>/tables.log",
    params:
        **report_params(PLAN),
        code=code_digest("texgs.cli.tables"),
        folder=subpath(output[0], parent=True),
    shell:
        "texgs tables {input.metrics:q} {params.earlier:q} --missing {params.left_out:q} "
        "{params.study:q} --output {params.folder:q} 2>&1 | tee {log:q}"


rule report:
    input:
        metrics=PLAN.metrics_shown(*RULES),
        note=PLAN.notes["report"],
    output:
        report("<results>/report.html", caption="../report/report.rst", category="report"),
    log:
        "<logs>/report.log",
    params:
        **report_params(PLAN),
        code=code_digest("texgs.cli.tables"),
    shell:
        "texgs report {input.metrics:q} {params.earlier:q} --missing {params.left_out:q} "
        "{params.study:q} --output {output:q} 2>&1 | tee {log:q}"
