# New looks for scenes and new parts of them, by any method; what can be measured of them, and scenes side by
# side.


rule edits:
    input:
        PLAN.done("edit", "edit_metrics"),


rule galleries:
    input:
        [file for sweep in PLAN.sweeps for file in PLAN.done("gallery", sweep=sweep)],


rule edit:
    input:
        reads("edit"),
    output:
        writes("edit"),
    log:
        log_of("edit"),
    threads: 4
    resources:
        gpu=FIT_GPU,
    params:
        code=code("edit"),
        words=words("edit"),
    shell:
        RUN


rule edit_metrics:
    input:
        reads("edit_metrics"),
    output:
        writes("edit_metrics"),
    log:
        log_of("edit_metrics"),
    threads: EVERY  # it measures frames, too
    resources:
        gpu=FIT_GPU,
    params:
        code=code("edit_metrics"),
        words=words("edit_metrics"),
    shell:
        RUN


rule gallery:
    input:
        reads("gallery"),
    output:
        writes("gallery"),
    log:
        log_of("gallery"),
    threads: 4
    resources:
        gpu=max(MAPPER_GPU, FIT_GPU),
    params:
        code=code("gallery"),
        words=words("gallery"),
    shell:
        RUN
