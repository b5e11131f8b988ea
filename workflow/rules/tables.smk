# Tables, from the metrics files of jobs.


rule tables:
    input:
        [
            f"{RESULTS}/{dataset}/{tf}/{CONFIG.fit.name}/{phase}/metrics.json"
            for dataset, tf in PAIRS
            for phase in ("surfels", "shading", "texture")
        ],
    output:
        collect("<results>/tables/fitting.{format}", format=("csv", "md", "tex")),
    log:
        "<logs>/tables.log",
    params:
        code=code_digest("texgs.report.fitting"),
        folder=subpath(output[0], parent=True),
    shell:
        "texgs tables {input:q} --output {params.folder:q} 2>&1 | tee {log:q}"
