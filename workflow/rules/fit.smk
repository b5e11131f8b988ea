# The three phases of a basic model, by the recipe of conf/fit, and a figure of what they are worth.


rule fits:
    input:
        done("texture"),


rule figures:
    input:
        done("figure"),


rule surfels:
    input:
        unpack(lambda wildcards: inputs("surfels", wildcards)),
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
        settings=lambda wildcards: settings("surfels", wildcards),
        code=STAGES["surfels"].code,
        folder=subpath(output.metrics, parent=True),
        files=lambda wildcards, input: [f"{name}={path}" for name, path in input.items()],
    shell:
        "texgs surfels --settings {params.settings:q} --input {params.files:q} "
        "--output {params.folder:q} 2>&1 | tee --append {log:q}"


rule shading:
    input:
        unpack(lambda wildcards: {"views": inputs("shading", wildcards)["views"]}),
        model="<results>/{dataset}/{tf}/{fit}/surfels/model.safetensors",
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
        settings=lambda wildcards: settings("shading", wildcards),
        code=STAGES["shading"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs shading --settings {params.settings:q} --input model={input.model:q} views={input.views:q} "
        "--output {params.folder:q} 2>&1 | tee --append {log:q}"


rule texture:
    input:
        unpack(lambda wildcards: {"views": inputs("texture", wildcards)["views"]}),
        model="<results>/{dataset}/{tf}/{fit}/shading/model.safetensors",
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
        settings=lambda wildcards: settings("texture", wildcards),
        code=STAGES["texture"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs texture --settings {params.settings:q} --input model={input.model:q} views={input.views:q} "
        "--output {params.folder:q} 2>&1 | tee --append {log:q}"


rule figure:
    input:
        unpack(lambda wildcards: {"views": inputs("figure", wildcards)["views"]}),
        surfels="<results>/{dataset}/{tf}/{fit}/surfels/model.safetensors",
        shading="<results>/{dataset}/{tf}/{fit}/shading/model.safetensors",
        texture="<results>/{dataset}/{tf}/{fit}/texture/model.safetensors",
    output:
        figure="<results>/{dataset}/{tf}/{fit}/figure/figure.png",
        metrics="<results>/{dataset}/{tf}/{fit}/figure/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/figure.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/figure.tsv"
    threads: 4
    params:
        settings=lambda wildcards: settings("figure", wildcards),
        code=STAGES["figure"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs figure --settings {params.settings:q} --input surfels={input.surfels:q} "
        "shading={input.shading:q} texture={input.texture:q} views={input.views:q} "
        "--output {params.folder:q} 2>&1 | tee --append {log:q}"
