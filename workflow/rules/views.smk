# Training and test views of each basic TF; a data set may also start from views that are there.


rule sheets:
    input:
        PLAN.done("sheet"),


rule views:
    input:
        reads("views"),
    output:
        writes("views"),
    log:
        log_of("views"),
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
        writes("sheet"),
    log:
        log_of("sheet"),
    params:
        code=code("sheet"),
        words=words("sheet"),
    shell:
        RUN
