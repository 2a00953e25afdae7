//! The experiments of the thesis' chapter 5, run on the server's core. `report.py` makes figures and tables of them.

mod make;
pub mod plan;
pub mod run;
