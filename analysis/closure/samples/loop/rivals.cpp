#include "analysis/closure/samples/loop/rivals.hpp"

#include <algorithm>
#include <cstddef>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/residual/tests.hpp"

namespace ringlock::closure {

std::vector<Rival> rivals_of(const SampleFit& fit, double lattice_arcsec, bool resampled, bool moved) {
    const std::size_t looked_at = options.samples.contest.most_rivals;
    auto views = view_samples(fit, lattice_arcsec);
    std::erase_if(views, [](const SampleView& view) { return view.test.merit < options.tie; });
    std::sort(views.begin(), views.end(),
              [](const SampleView& a, const SampleView& b) { return a.test.merit > b.test.merit; });
    std::vector<Where> columns;
    std::size_t place = 0;
    std::erase_if(views, [&](const SampleView& view) {
        // Tests of jumps are always kept: a random rate can follow them, and no other test shows them. The best test of
        // each kind of other column is kept as well, since trends in time come near to it.
        const bool follows = view.columns && view.test.where != Where::time && !view.hz;
        const bool first = follows && std::find(columns.begin(), columns.end(), view.test.where) == columns.end();
        if (first) columns.push_back(view.test.where);
        return place++ >= looked_at && !view.jumps && !first;
    });
    std::vector<Rival> found;
    for (const SampleView& view : views) {
        const bool repeats = view.test.view == repeating_variance;
        Rival rival{.merit = view.test.merit,
                    .where = view.test.where,
                    .jumps = view.jumps,
                    .repeats = repeats,
                    .hz = view.hz,
                    .by_variance = view.by_variance};
        if (view.columns) {
            rival.merit = refitted_merit(fit, view);
            const bool courses = view.test.where == Where::time && !view.jumps;
            rival.courses = courses ? static_cast<double>(view.columns().size()) : view.courses;
        }
        if (repeats && resampled) rival.merit = std::max(rival.merit, view.refitted(0.0));
        const bool levels = view.test.view == jumping_rate;
        if (levels && view.refitted) rival.of_states = view.refitted(0.0);
        rival.of_a_motion = !repeats && !levels && view.refitted && moved ? view.refitted(0.0) : rival.merit;
        found.push_back(rival);
    }
    return found;
}

}  // namespace ringlock::closure
