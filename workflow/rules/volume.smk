# A scalar field, checked, in one file; and its histogram with the basic TFs.


rule volumes:
    input:
        done("transfer"),


rule downloads:
    input:
        list(PLAN["downloads"]),


# Nodes of a cluster often have no way to the internet: this runs where Snakemake does.
rule download:
    output:
        update(f"{CACHE}/{{checksum}}/{{file}}"),
    log:
        "<logs>/downloads/{checksum}-{file}.log",
    wildcard_constraints:
        checksum="[0-9a-fA-F]{12}",
        file="[^/]+",
    localrule: True
    params:
        source=lambda wildcards, output: PLAN["downloads"][output[0]],
    shell:
        "texgs download {params.source[0]:q} --sha256 {params.source[1]:q} --output {output:q} "
        "2>&1 | tee --append {log:q}"


rule volume:
    input:
        unpack(lambda wildcards: inputs("volume", wildcards)),
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
        settings=lambda wildcards: settings("volume", wildcards),
        code=STAGES["volume"].code,
        folder=subpath(output.metrics, parent=True),
        source=lambda wildcards, input: (f"--input source={shlex.quote(input.source)}" if input else ""),
    shell:
        "texgs volume --settings {params.settings:q} {params.source} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"


rule transfer:
    input:
        volume="<results>/{dataset}/volume/volume.nrrd",
        summary="<results>/{dataset}/volume/volume.json",
    output:
        plot="<results>/{dataset}/transfer/transfer.png",
        metrics="<results>/{dataset}/transfer/metrics.json",
    log:
        "<logs>/{dataset}/transfer.log",
    benchmark:
        "<benchmarks>/{dataset}/transfer.tsv"
    params:
        settings=lambda wildcards: settings("transfer", wildcards),
        code=STAGES["transfer"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs transfer --settings {params.settings:q} --input volume={input.volume:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"
