# The three phases of a basic model, by the recipe of conf/fit, and a figure of what they are worth.


rule fits:
    input:
        PLAN.done("texture"),


rule figures:
    input:
        PLAN.done("figure"),


rule surfels:
    input:
        reads("surfels"),
    output:
        model="<results>/{dataset}/{tf}/{fit}/surfels/model.safetensors",
        metrics="<results>/{dataset}/{tf}/{fit}/surfels/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/surfels.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/surfels.tsv"
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("surfels"),
        words=words("surfels"),
    shell:
        RUN


rule shading:
    input:
        reads("shading"),
    output:
        model="<results>/{dataset}/{tf}/{fit}/shading/model.safetensors",
        metrics="<results>/{dataset}/{tf}/{fit}/shading/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/shading.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/shading.tsv"
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("shading"),
        words=words("shading"),
    shell:
        RUN


rule texture:
    input:
        reads("texture"),
    output:
        model="<results>/{dataset}/{tf}/{fit}/texture/model.safetensors",
        metrics="<results>/{dataset}/{tf}/{fit}/texture/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/texture.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/texture.tsv"
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("texture"),
        words=words("texture"),
    shell:
        RUN


rule figure:
    input:
        reads("figure"),
    output:
        figure="<results>/{dataset}/{tf}/{fit}/figure/figure.png",
        metrics="<results>/{dataset}/{tf}/{fit}/figure/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/figure.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/figure.tsv"
    threads: 4
    params:
        code=code("figure"),
        words=words("figure"),
    shell:
        RUN
