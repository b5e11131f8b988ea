# The whole experiment: volume -> views -> contact sheets, for every data set and basic transfer function.
#
#   snakemake --cores all                                          the default data set
#   snakemake --cores all --config experiment=demo                 a file of conf/experiment
#   snakemake --cores all --config dataset=engine overrides="views=paper views.width=400"
from snakemake.utils import min_version

min_version("9.19")


# Used only with --software-deployment-method apptainer: the image in which `make install` has made .venv.
container: "docker://python:3.11-bookworm"


include: "workflow/rules/common.smk"
include: "workflow/rules/volume.smk"
include: "workflow/rules/views.smk"
include: "workflow/rules/fit.smk"
include: "workflow/rules/tables.smk"


rule all:
    default_target: True
    input:
        rules.volumes.input,
        rules.sheets.input,
        rules.tables.output,


onsuccess:
    print(f"Done: {RESULTS}/tables/fitting.md; pictures in {RESULTS}/*/transfer and {RESULTS}/*/*/sheet")
    if STORE is not None and STORE.startswith("sqlite"):
        print(f"Runs: {shlex.quote(sys.executable)} -m mlflow ui --backend-store-uri {STORE}")
