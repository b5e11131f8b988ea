# A scalar field, checked, in one file; and its histogram with the basic TFs.


rule volumes:
    input:
        done("transfer"),


rule volume:
    input:
        reads("volume"),
    output:
        volume="<results>/{dataset}/volume/volume.nrrd",
        summary="<results>/{dataset}/volume/volume.json",
        metrics="<results>/{dataset}/volume/metrics.json",
    log:
        "<logs>/{dataset}/volume.log",
    benchmark:
        "<benchmarks>/{dataset}/volume.tsv"
    threads: 1
    params:
        code=STAGES["volume"].code,
        words=words("volume"),
    shell:
        RUN


rule transfer:
    input:
        reads("transfer"),
    output:
        plot="<results>/{dataset}/transfer/transfer.png",
        metrics="<results>/{dataset}/transfer/metrics.json",
    log:
        "<logs>/{dataset}/transfer.log",
    benchmark:
        "<benchmarks>/{dataset}/transfer.tsv"
    params:
        code=STAGES["transfer"].code,
        words=words("transfer"),
    shell:
        RUN
