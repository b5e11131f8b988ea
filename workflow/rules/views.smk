# Training and test views of each basic TF; a data set may also start from views that are there.


rule sheets:
    input:
        done("sheet"),


rule views:
    input:
        volume="<results>/{dataset}/volume/volume.nrrd",
        summary="<results>/{dataset}/volume/volume.json",
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
        settings=lambda wildcards: settings("views", wildcards),
        code=STAGES["views"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs views --settings {params.settings:q} --input volume={input.volume:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"


rule sheet:
    input:
        unpack(lambda wildcards: inputs("sheet", wildcards)),
    output:
        sheet="<results>/{dataset}/{tf}/sheet/sheet.png",
        metrics="<results>/{dataset}/{tf}/sheet/metrics.json",
    log:
        "<logs>/{dataset}/{tf}/sheet.log",
    benchmark:
        "<benchmarks>/{dataset}/{tf}/sheet.tsv"
    params:
        settings=lambda wildcards: settings("sheet", wildcards),
        code=STAGES["sheet"].code,
        folder=subpath(output.metrics, parent=True),
    shell:
        "texgs sheet --settings {params.settings:q} --input views={input.views:q} --output {params.folder:q} "
        "2>&1 | tee --append {log:q}"
