# A scalar field, checked, in one file; and its histogram with the basic TFs.


rule volumes:
    input:
        PLAN.done("transfer"),


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


rule volume:
    input:
        reads("volume"),
    output:
        writes("volume"),
    log:
        log_of("volume"),
    threads: 1
    params:
        code=code("volume"),
        words=words("volume"),
    shell:
        RUN


rule transfer:
    input:
        reads("transfer"),
    output:
        writes("transfer"),
    log:
        log_of("transfer"),
    params:
        code=code("transfer"),
        words=words("transfer"),
    shell:
        RUN
