# A rule for each kind of job, from the stages in texgs/workflow/stages, and what is asked for by one name:
# volumes, sheets, fits, figures, comparisons, meshes, scenes, edits and galleries.

for target in TARGETS:

    rule:
        name:
            target
        input:
            PLAN.target(target),


for each in RULES.values():

    rule:
        name:
            each.name
        input:
            JOBS.reads(each),
        output:
            list(made(each)),
        log:
            f"<logs>/{each.folder}.log",
        threads: each.threads
        resources:
            gpu=PLAN.gpus(each),
        params:
            code=JOBS.code(each),
            words=JOBS.words(each),
        # Snakemake removes the log of an earlier attempt.
        shell:
            "texgs {params.words:q} 2>&1 | tee {log:q}"


rule downloads:
    input:
        list(PLAN.downloads),


# Nodes of a cluster often have no way to the internet: this runs where Snakemake does.
rule download:
    output:
        f"{CACHE}/{{checksum}}/{{file}}",
    log:
        "<logs>/downloads/{checksum}-{file}.log",
    wildcard_constraints:
        checksum="[0-9a-fA-F]{12}",
        file="[^/]+",
    localrule: True
    params:
        source=lambda wildcards, output: PLAN.downloads[output[0]],
    shell:
        "texgs download {params.source[0]:q} --sha256 {params.source[1]:q} --output {output:q} "
        "2>&1 | tee {log:q}"
