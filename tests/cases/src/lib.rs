//! How many cases the tests with many of them try.

/// A tenth of `all`, at least one; `all` if the environment has `GRASP_TEST_CASES=all`, as in `tests/run --all`.
///
/// For tests whose cases are alike and slow. The first cases should differ most.
pub fn cases(all: u32) -> u32 {
    short_or_long(all.div_ceil(10), all)
}

/// The first number, or the second if the environment has `GRASP_TEST_CASES=all`.
pub fn short_or_long(short: u32, long: u32) -> u32 {
    if std::env::var_os("GRASP_TEST_CASES").is_some_and(|value| value == "all") {
        long
    } else {
        short
    }
}
