# The whole experiment: volume -> views -> models -> scene -> edits, timing, tables and a report.
#
#   snakemake --cores all                                          the default data set
#   snakemake --cores all --config experiment=demo                 a file of conf/experiment
#   snakemake --cores all --config dataset=engine overrides="views=paper views.width=400"
from snakemake.utils import min_version

min_version("9.19")


# Used only with --software-deployment-method apptainer: the image in which `make install` has made .venv.
container: "docker://python:3.11-bookworm"


include: "workflow/rules/common.smk"
include: "workflow/rules/stages.smk"
include: "workflow/rules/tables.smk"


rule all:
    default_target: True
    input:
        [PLAN.target(name) for name in TARGETS],
        rules.tables.output,
        rules.report.output,


onstart:
    RUN.begin()


onsuccess:
    RUN.succeed()


onerror:
    RUN.fail()
