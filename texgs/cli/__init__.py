"""The command line: one file for each verb, or for several alike."""
