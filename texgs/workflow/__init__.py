"""The engine: stages, the plan of a run, jobs, their results and tracked runs."""
