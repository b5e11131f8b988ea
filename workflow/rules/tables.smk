# Tables and the report, from the metrics files of jobs.


from texgs.workflow.plan import SWEPT
from texgs.report.table import DOCUMENT, FORMATS
from texgs.report.tables import specs

SWEEPS = sorted(name for name in PLAN.sweeps if name and PLAN.done("phase", sweep=name))
OF_SWEEPS = {file for name in SWEEPS for file in PLAN.done(*SWEPT, sweep=name)}
TABLES = specs(SWEEPS)
STUDY = Path(RESULTS, "study")  # its ballots never change, and more of them make another table


rule tables:
    input:
        sorted({*PLAN.done(*{place for table in TABLES for place in table.places}), *OF_SWEEPS}),
    output:
        f"<results>/tables/{DOCUMENT}",
        collect("<results>/tables/{table}.{format}", table=[table.name for table in TABLES], format=FORMATS),
    log:
        "<logs>/tables.log",
    params:
        code=PLAN.code["texgs.cli.tables"],
        folder=subpath(output[0], parent=True),
        earlier=list(PLAN.earlier),
        of_earlier=list(PLAN.earlier.values()),
        left_out=PLAN.left_out,
        study=f"{STUDY}/key.json",
        ballots=sorted(map(str, STUDY.glob("votes/*.csv"))),
    shell:
        "texgs tables {input:q} {params.earlier:q} --missing {params.left_out:q} --study {params.study:q} "
        "--output {params.folder:q} 2>&1 | tee {log:q}"


rule report:
    input:
        sorted({*PLAN.done(*PLACES), *OF_SWEEPS}),
    output:
        "<results>/report.html",
    log:
        "<logs>/report.log",
    params:
        code=PLAN.code["texgs.cli.report"],
        earlier=list(PLAN.earlier),
        of_earlier=list(PLAN.earlier.values()),
        left_out=PLAN.left_out,
        study=f"{STUDY}/key.json",
        ballots=sorted(map(str, STUDY.glob("votes/*.csv"))),
    shell:
        "texgs report {input:q} {params.earlier:q} --missing {params.left_out:q} --study {params.study:q} "
        "--output {output:q} 2>&1 | tee {log:q}"
