# The phases of a basic model, by the recipe of conf/fit, and a figure of what they are worth.


rule fits:
    input:
        PLAN.done("phase"),


rule figures:
    input:
        PLAN.done("figure"),


rule comparisons:
    input:
        PLAN.done("comparison"),


rule meshes:
    input:
        PLAN.done("mesh"),


rule phase:
    input:
        reads("phase"),
    output:
        writes("phase"),
    log:
        log_of("phase"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("phase"),
        words=words("phase"),
    shell:
        RUN


rule figure:
    input:
        reads("figure"),
    output:
        writes("figure"),
    log:
        log_of("figure"),
    threads: 4
    params:
        code=code("figure"),
        words=words("figure"),
    shell:
        RUN


rule comparison:
    input:
        reads("comparison"),
    output:
        writes("comparison"),
    log:
        log_of("comparison"),
    threads: 4
    params:
        code=code("comparison"),
        words=words("comparison"),
    shell:
        RUN


rule mesh:
    input:
        reads("mesh"),
    output:
        writes("mesh"),
    log:
        log_of("mesh"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("mesh"),
        words=words("mesh"),
    shell:
        RUN
