-- Parametrised problems are evaluated by a program of their own, `python -m signorini.umbridge`, which reads them from
-- files. Those that were registered here have been written to such files when this runs: see store/model_files.rs.
drop table model_problem;
drop table model;
