# Basic models as one scene; its edits and its speed beside those of the volume.


rule scenes:
    input:
        PLAN.done("compose", "pse", "timing", "page"),


rule compose:
    input:
        reads("compose"),
    output:
        writes("compose"),
    log:
        log_of("compose"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("compose"),
        words=words("compose"),
    shell:
        RUN


rule pse:
    input:
        reads("pse"),
    output:
        writes("pse"),
    log:
        log_of("pse"),
    threads: 4
    resources:
        gpu=max(MAPPER_GPU, FIT_GPU),
    params:
        code=code("pse"),
        words=words("pse"),
    shell:
        RUN


# All threads: other jobs would be measured with it.
rule timing:
    input:
        reads("timing"),
    output:
        writes("timing"),
    log:
        log_of("timing"),
    threads: EVERY
    resources:
        gpu=max(MAPPER_GPU, FIT_GPU),
    params:
        code=code("timing"),
        words=words("timing"),
    shell:
        RUN


rule page:
    input:
        reads("page"),
    output:
        writes("page"),
    log:
        log_of("page"),
    threads: 2
    params:
        code=code("page"),
        words=words("page"),
    shell:
        RUN
