# Basic models as one scene; its edits and its speed beside those of the volume.


rule scenes:
    input:
        done("compose", "pse", "timing"),


rule compose:
    input:
        lambda wildcards: list(inputs("compose", wildcards).values()),
    output:
        scene="<results>/{dataset}/scene/{fit}/compose/scene.yaml",
        picture="<results>/{dataset}/scene/{fit}/compose/scene.png",
        metrics="<results>/{dataset}/scene/{fit}/compose/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/compose.log",
    threads: 4
    params:
        settings=lambda wildcards: settings("compose", wildcards),
        code=STAGES["compose"].code,
        folder=subpath(output.metrics, parent=True),
        models=lambda wildcards: [f"{tf}={path}" for tf, path in inputs("compose", wildcards).items()],
    shell:
        "texgs compose --settings {params.settings:q} --input {params.models:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"


rule pse:
    input:
        unpack(lambda wildcards: inputs("pse", wildcards)),
    output:
        pse="<results>/{dataset}/scene/{fit}/pse/pse.png",
        relight="<results>/{dataset}/scene/{fit}/pse/relight.png",
        metrics="<results>/{dataset}/scene/{fit}/pse/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/pse.log",
    benchmark:
        "<benchmarks>/{dataset}/scene/{fit}/pse.tsv"
    threads: 4
    params:
        settings=lambda wildcards: settings("pse", wildcards),
        code=STAGES["pse"].code,
        folder=subpath(output.metrics, parent=True),
        files=lambda wildcards, input: [f"{name}={path}" for name, path in input.items()],
    shell:
        "texgs pse --settings {params.settings:q} --input {params.files:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"


# As many threads as most machines have: other jobs would be measured with it.
rule timing:
    input:
        unpack(lambda wildcards: inputs("timing", wildcards)),
    output:
        metrics="<results>/{dataset}/scene/{fit}/timing/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/timing.log",
    threads: 16
    resources:
        gpu=FIT_GPU,
    params:
        settings=lambda wildcards: settings("timing", wildcards),
        code=STAGES["timing"].code,
        folder=subpath(output.metrics, parent=True),
        files=lambda wildcards, input: [f"{name}={path}" for name, path in input.items()],
    shell:
        "texgs timing --settings {params.settings:q} --input {params.files:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"
