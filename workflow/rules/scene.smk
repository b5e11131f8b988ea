# Basic models as one scene; its edits and its speed beside those of the volume.


rule scenes:
    input:
        PLAN.done("compose", "pse", "timing"),


rule compose:
    input:
        reads("compose"),
    output:
        scene="<results>/{dataset}/scene/{fit}/compose/scene.yaml",
        picture="<results>/{dataset}/scene/{fit}/compose/scene.png",
        metrics="<results>/{dataset}/scene/{fit}/compose/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/compose.log",
    threads: 4
    params:
        code=code("compose"),
        words=words("compose"),
    shell:
        RUN


rule pse:
    input:
        reads("pse"),
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
        code=code("pse"),
        words=words("pse"),
    shell:
        RUN


# As many threads as most machines have: other jobs would be measured with it.
rule timing:
    input:
        reads("timing"),
    output:
        metrics="<results>/{dataset}/scene/{fit}/timing/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/timing.log",
    threads: 16
    resources:
        gpu=FIT_GPU,
    params:
        code=code("timing"),
        words=words("timing"),
    shell:
        RUN
