"""Counts the entries that other orderings leave in the factor of a stiffness matrix, and prints one line of JSON.

Usage: target/release/reference factor PROBLEM | target/peers/bin/python fill.py

The first line has the number of unknowns and the entries of Signorini's factor; each other line the unknowns of one
element. The matrix has an entry for every two unknowns of an element. CHOLMOD orders it by METIS and by AMD, and counts
what its factor has in the lower triangle.
"""

import json
import sys

import numpy
import scipy.sparse
import sksparse.cholmod

ORDERINGS = ("metis", "amd")


def main():
    size, own = map(int, sys.stdin.readline().split())
    rows, columns = [], []
    for line in sys.stdin:
        unknowns = numpy.fromstring(line, dtype=numpy.int64, sep=" ")
        rows.append(numpy.repeat(unknowns, len(unknowns)))
        columns.append(numpy.tile(unknowns, len(unknowns)))
    rows, columns = numpy.concatenate(rows), numpy.concatenate(columns)
    pattern = scipy.sparse.csc_matrix((numpy.full(len(rows), -1.0), (rows, columns)), (size, size))
    # positive definite by its diagonal
    sums = numpy.asarray(abs(pattern).sum(axis=1)).ravel()
    matrix = (pattern + scipy.sparse.diags(2.0 * sums)).tocsc()
    found = {"unknowns": size, "signorini": own}
    for ordering in ORDERINGS:
        factor = sksparse.cholmod.cholesky(matrix, ordering_method=ordering, mode="simplicial")
        found[ordering] = int(factor.L().nnz)
    print(json.dumps(found))


main()
