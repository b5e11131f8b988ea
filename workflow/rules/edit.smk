# New looks for scenes: by a picture, by words, in a part of them; and what can be measured of them.


rule edits:
    input:
        PLAN.done(*EDITS),


rule edit_image:
    input:
        reads("edit_image"),
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
        edit=any_of(PLAN.edits["image"], "no-edit"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("edit_image"),
        words=words("edit_image"),
    shell:
        RUN


rule edit_text:
    input:
        reads("edit_text"),
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
        edit=any_of(PLAN.edits["text"], "no-edit"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("edit_text"),
        words=words("edit_text"),
    shell:
        RUN


rule edit_segment:
    input:
        reads("edit_segment"),
    output:
        scene="<results>/{dataset}/scene/{fit}/edits/{edit}/scene.yaml",
        picture="<results>/{dataset}/scene/{fit}/edits/{edit}/edit.png",
        metrics="<results>/{dataset}/scene/{fit}/edits/{edit}/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/edits/{edit}.log",
    benchmark:
        "<benchmarks>/{dataset}/scene/{fit}/edits/{edit}.tsv"
    wildcard_constraints:
        edit=any_of(PLAN.edits["segment"], "no-edit"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("edit_segment"),
        words=words("edit_segment"),
    shell:
        RUN


rule edit_metrics:
    input:
        reads("edit_metrics"),
    output:
        metrics="<results>/{dataset}/scene/{fit}/edit_metrics/{edit}/metrics.json",
    log:
        "<logs>/{dataset}/scene/{fit}/edit_metrics/{edit}.log",
    threads: 16
    resources:
        gpu=FIT_GPU,
    params:
        code=code("edit_metrics"),
        words=words("edit_metrics"),
    shell:
        RUN
