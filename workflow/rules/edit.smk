# New looks for scenes: by a picture, by words, in a part of them; and what can be measured of them.


rule edits:
    input:
        done(*EDITS),


rule edit_image:
    input:
        lambda wildcards: list(inputs("edit_image", wildcards).values()),
    output:
        scene="<results>/{dataset}/scene/{fit}/edits/{edit}/scene.yaml",
        picture="<results>/{dataset}/scene/{fit}/edits/{edit}/edit.png",
        convergence="<results>/{dataset}/scene/{fit}/edits/{edit}/convergence.png",
        metrics="<results>/{dataset}/scene/{fit}/edits/{edit}/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/edits/{edit}.log",
    benchmark:
        "<benchmarks>/{dataset}/scene/{fit}/edits/{edit}.tsv"
    wildcard_constraints:
        edit=edits_of("image"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        settings=lambda wildcards: settings("edit_image", wildcards),
        code=STAGES["edit_image"].code,
        folder=subpath(output.metrics, parent=True),
        files=lambda wildcards: [f"{k}={v}" for k, v in inputs("edit_image", wildcards).items()],
    shell:
        "texgs edit_image --settings {params.settings:q} --input {params.files:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"


rule edit_text:
    input:
        lambda wildcards: list(inputs("edit_text", wildcards).values()),
    output:
        scene="<results>/{dataset}/scene/{fit}/edits/{edit}/scene.yaml",
        picture="<results>/{dataset}/scene/{fit}/edits/{edit}/edit.png",
        views="<results>/{dataset}/scene/{fit}/edits/{edit}/views.png",
        metrics="<results>/{dataset}/scene/{fit}/edits/{edit}/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/edits/{edit}.log",
    benchmark:
        "<benchmarks>/{dataset}/scene/{fit}/edits/{edit}.tsv"
    wildcard_constraints:
        edit=edits_of("text"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        settings=lambda wildcards: settings("edit_text", wildcards),
        code=STAGES["edit_text"].code,
        folder=subpath(output.metrics, parent=True),
        files=lambda wildcards: [f"{k}={v}" for k, v in inputs("edit_text", wildcards).items()],
    shell:
        "texgs edit_text --settings {params.settings:q} --input {params.files:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"


rule edit_segment:
    input:
        lambda wildcards: list(inputs("edit_segment", wildcards).values()),
    output:
        scene="<results>/{dataset}/scene/{fit}/edits/{edit}/scene.yaml",
        picture="<results>/{dataset}/scene/{fit}/edits/{edit}/edit.png",
        metrics="<results>/{dataset}/scene/{fit}/edits/{edit}/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/edits/{edit}.log",
    benchmark:
        "<benchmarks>/{dataset}/scene/{fit}/edits/{edit}.tsv"
    wildcard_constraints:
        edit=edits_of("segment"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        settings=lambda wildcards: settings("edit_segment", wildcards),
        code=STAGES["edit_segment"].code,
        folder=subpath(output.metrics, parent=True),
        files=lambda wildcards: [f"{k}={v}" for k, v in inputs("edit_segment", wildcards).items()],
    shell:
        "texgs edit_segment --settings {params.settings:q} --input {params.files:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"


rule edit_metrics:
    input:
        lambda wildcards: list(inputs("edit_metrics", wildcards).values()),
    output:
        metrics="<results>/{dataset}/scene/{fit}/edit_metrics/{edit}/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/edit_metrics/{edit}.log",
    threads: 16
    resources:
        gpu=FIT_GPU,
    params:
        settings=lambda wildcards: settings("edit_metrics", wildcards),
        code=STAGES["edit_metrics"].code,
        folder=subpath(output.metrics, parent=True),
        files=lambda wildcards: [f"{k}={v}" for k, v in inputs("edit_metrics", wildcards).items()],
    shell:
        "texgs edit_metrics --settings {params.settings:q} --input {params.files:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"
