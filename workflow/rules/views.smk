# Training and test views of each basic TF; a data set may also start from views that are there.


rule sheets:
    input:
        PLAN.done("sheet"),


rule views:
    input:
        reads("views"),
    output:
        train="<results>/{dataset}/{tf}/{views}/transforms_train.json",
        test="<results>/{dataset}/{tf}/{views}/transforms_test.json",
        turntable="<results>/{dataset}/{tf}/{views}/turntable.png",
        metrics="<results>/{dataset}/{tf}/{views}/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/{views}.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/{views}.tsv"
    threads: 4
    resources:
        gpu=MAPPER_GPU,
    params:
        code=code("views"),
        words=words("views"),
    shell:
        RUN


rule sheet:
    input:
        reads("sheet"),
    output:
        sheet="<results>/{dataset}/{tf}/sheet/sheet.png",
        metrics="<results>/{dataset}/{tf}/sheet/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/sheet.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/sheet.tsv"
    params:
        code=code("sheet"),
        words=words("sheet"),
    shell:
        RUN
