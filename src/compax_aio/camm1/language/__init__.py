"""
The cutting languages, mode 1 and mode 2: jobs in pieces of any size, taken apart into whole instructions.

``tokeniser`` takes apart, ``job`` reads one that is at hand, ``splitting`` parts long lists, ``stripping`` takes out
what is none of the job, ``tracking`` follows the tool.
"""
