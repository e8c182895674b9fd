"""What a job will cut, drawn: from instructions to ways of the tool, laid out on a page, written as SVG or PNG."""
