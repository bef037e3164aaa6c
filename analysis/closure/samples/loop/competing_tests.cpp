#include "analysis/closure/samples/loop/competing_tests.hpp"

#include <algorithm>
#include <cstddef>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/residual/tests.hpp"

namespace ringlock::closure {

std::vector<CompetingTest> competing_tests_of(const SampleFit& fit, double lattice_arcsec, bool resampled, bool moved) {
    const std::size_t looked_at = options.samples.contest.most_competing_tests;
    auto tests = test_residual(fit, lattice_arcsec);
    std::erase_if(tests, [](const SampleResidualTest& test) { return test.result.evidence < options.tie; });
    std::sort(tests.begin(), tests.end(), [](const SampleResidualTest& a, const SampleResidualTest& b) {
        return a.result.evidence > b.result.evidence;
    });
    std::vector<Where> columns;
    std::size_t place = 0;
    std::erase_if(tests, [&](const SampleResidualTest& test) {
        // Tests of jumps are always kept: a random rate can follow them, and no other test shows them. The best test of
        // each kind of other column is kept as well, since trends in time come near to it.
        const bool follows = test.columns && test.result.where != Where::time && !test.hz;
        const bool first = follows && std::find(columns.begin(), columns.end(), test.result.where) == columns.end();
        if (first) columns.push_back(test.result.where);
        return place++ >= looked_at && !test.jumps && !first;
    });
    std::vector<CompetingTest> found;
    for (const SampleResidualTest& test : tests) {
        const bool repeats = test.result.subject == repeating_variance;
        CompetingTest competing{.evidence = test.result.evidence,
                                .where = test.result.where,
                                .jumps = test.jumps,
                                .repeats = repeats,
                                .hz = test.hz,
                                .by_variance = test.by_variance};
        if (test.columns) {
            competing.evidence = refitted_evidence(fit, test);
            const bool trends = test.result.where == Where::time && !test.jumps;
            competing.trends = trends ? static_cast<double>(test.columns().size()) : test.trends;
        }
        if (repeats && resampled) competing.evidence = std::max(competing.evidence, test.refitted(0.0));
        const bool levels = test.result.subject == jumping_rate;
        if (levels && test.refitted) competing.of_states = test.refitted(0.0);
        competing.of_a_motion = !repeats && !levels && test.refitted && moved ? test.refitted(0.0) : competing.evidence;
        found.push_back(competing);
    }
    return found;
}

}  // namespace ringlock::closure
