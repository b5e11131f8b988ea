# The three phases of a basic model, by the recipe of conf/fit.


rule fits:
    input:
        [f"{RESULTS}/{dataset}/{tf}/{CONFIG.fit.name}/texture/metrics.json" for dataset, tf in PAIRS],


rule surfels:
    input:
        unpack(lambda wildcards: {"views": inputs("sheet", wildcards)["views"]}),
    output:
        model="<results>/{dataset}/{tf}/{fit}/surfels/model.safetensors",
        metrics="<results>/{dataset}/{tf}/{fit}/surfels/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/surfels.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/surfels.tsv"
    threads: 4
    params:
        settings=lambda wildcards: settings("surfels", wildcards),
        code=STAGES["surfels"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs surfels --settings {params.settings:q} --input views={input.views:q} "
        "--output {params.folder:q} 2>&1 | tee {log:q}"


rule shading:
    input:
        unpack(lambda wildcards: {"views": inputs("sheet", wildcards)["views"]}),
        model="<results>/{dataset}/{tf}/{fit}/surfels/model.safetensors",
    output:
        model="<results>/{dataset}/{tf}/{fit}/shading/model.safetensors",
        metrics="<results>/{dataset}/{tf}/{fit}/shading/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/shading.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/shading.tsv"
    threads: 4
    params:
        settings=lambda wildcards: settings("shading", wildcards),
        code=STAGES["shading"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs shading --settings {params.settings:q} --input model={input.model:q} views={input.views:q} "
        "--output {params.folder:q} 2>&1 | tee {log:q}"


rule texture:
    input:
        unpack(lambda wildcards: {"views": inputs("sheet", wildcards)["views"]}),
        model="<results>/{dataset}/{tf}/{fit}/shading/model.safetensors",
    output:
        model="<results>/{dataset}/{tf}/{fit}/texture/model.safetensors",
        metrics="<results>/{dataset}/{tf}/{fit}/texture/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{fit}/texture.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{fit}/texture.tsv"
    threads: 4
    params:
        settings=lambda wildcards: settings("texture", wildcards),
        code=STAGES["texture"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs texture --settings {params.settings:q} --input model={input.model:q} views={input.views:q} "
        "--output {params.folder:q} 2>&1 | tee {log:q}"
