#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/decide/evidence.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/samples/residual/simulated.hpp"
#include "analysis/closure/samples/residual/tests.hpp"
#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

namespace {

ResidualTest test_of(const Disturbed& disturbed) {
    const bool any = disturbed.share > 0.0;
    return {Where::time, fmt::format("stretches of {:.3g} s far larger than the others", disturbed.length_s),
            any ? disturbed.p_value : 1.0,
            any ? fmt::format("{:.1f} % of the record, most at {:.6g} s, {:.3g} times the usual variance",
                              100.0 * disturbed.share, disturbed.at_s, disturbed.worst)
                : ""};
}

}  // namespace

/// Tests the residual. If any test passes the level, the reported structure is that of the regression that explains
/// most with the noise fitted again; if no regression explains anything, that of the test with the smallest p-value.
void SampleLoop::test_what_is_left(Closure& closure) const {
    const std::size_t looked_at = options.samples.loop.most_tests;
    auto tests = test_residual(*now_.fit, lattice_step());
    tests.push_back({test_of(find_disturbed(*now_.fit, whole_))});
    if (rounded_.drawn()) tests.push_back({rounded_.test(*now_.fit)});
    const auto count = static_cast<double>(tests.size());
    const auto may_be_chance = [count](const SampleResidualTest& test) {
        return of_several(test.result.p_value, count) >= options.level_of_residual;
    };
    if (!std::all_of(tests.begin(), tests.end(), may_be_chance)) {
        correct_for_counts(*now_.fit, lattice_step(), tests);
    }
    closure.tests.clear();
    for (const SampleResidualTest& test : tests) closure.tests.push_back(test.result);
    closure.unexplained.reset();
    std::erase_if(tests, may_be_chance);
    if (tests.empty()) return;
    std::sort(tests.begin(), tests.end(), [](const SampleResidualTest& a, const SampleResidualTest& b) {
        return a.result.p_value < b.result.p_value;
    });
    closure.unexplained = tests.front().result;
    std::sort(tests.begin(), tests.end(), [](const SampleResidualTest& a, const SampleResidualTest& b) {
        return a.result.evidence > b.result.evidence;
    });
    if (tests.size() > looked_at) tests.resize(looked_at);
    double most = 0.0;
    const SampleResidualTest* regression = nullptr;
    for (const SampleResidualTest& test : tests) {
        if (!test.columns) continue;
        const double evidence = refitted_evidence(*now_.fit, test);
        if (evidence <= most) continue;
        most = evidence;
        regression = &test;
        closure.unexplained = test.result;
    }
    // A strong rate looks like lines: those count only if they remain when the rate is fitted.
    std::vector<SampleResidualTest> repeated;
    if (regression != nullptr) repeated = test_residual(fit_with_columns(*now_.fit, *regression), lattice_step());
    for (const SampleResidualTest& test : tests) {
        if (test.columns || !(test.result.evidence > most)) continue;
        const bool stays =
            repeated.empty() || std::any_of(repeated.begin(), repeated.end(), [&](const SampleResidualTest& other) {
                return other.result.subject == test.result.subject &&
                       of_several(other.result.p_value, count) < options.level_of_residual;
            });
        if (!stays) continue;
        most = test.result.evidence;
        closure.unexplained = test.result;
    }
}

/// Stretches that are excluded from all fits because they are far larger than the others are structure as well. They
/// are no rate and no line, so that effects which have been reported stay.
void SampleLoop::test_left_out(Closure& closure) const {
    if (std::find(disturbed_.rows.begin(), disturbed_.rows.end(), 1) == disturbed_.rows.end()) return;
    const ResidualTest test = test_of(still_disturbed());
    const auto same = std::find_if(closure.tests.begin(), closure.tests.end(),
                                   [&](const auto& t) { return t.subject == test.subject; });
    if (same != closure.tests.end() && same->p_value < test.p_value) return;
    if (same == closure.tests.end()) {
        closure.tests.push_back(test);
    } else {
        *same = test;
    }
    const auto count = static_cast<double>(closure.tests.size());
    if (!closure.unexplained && of_several(test.p_value, count) < options.level_of_residual) closure.unexplained = test;
}

void SampleLoop::begin_again(const State& at) {
    now_ = at;
    // The fit of that state was to increments that have been imputed again since.
    if (rounded_.drawn()) now_.fit = rounded_.draw(now_.fit, options.samples.loop.draws);
}

/// A random rate was added but left structure, so that it may only substitute for another rate. The loop continues
/// without random rates from the model before it: if several effects of the library together leave no structure and are
/// more likely, they are the answer. Otherwise no rate is reported, and effects that were found after the random rate
/// stay unless they are rates.
void SampleLoop::go_without_random(Closure& closure) {
    const State followed = now_;
    const std::optional<ResidualTest> left = closure.unexplained;
    const std::vector<ResidualTest> tests = closure.tests;
    begin_again(*earlier_);
    add_all(closure, false);
    test_what_is_left(closure);
    if (!closure.unexplained && now_.fit->gain_over(*followed.fit) > 0.0) return;
    begin_again(followed);
    closure.unexplained = left;
    closure.tests = tests;
    const auto keeps = [](const AddedEffect& added) { return !is_slow_rate(added.effect()); };
    if (keep_names(earlier_->added.empty() ? 0 : earlier_->added.back().id + 1, keeps, closure)) return;
    begin_again(*earlier_);
    test_what_is_left(closure);
}

/// The residual contains a rate or a line that no effect of the library explains. The closest effect is added as a
/// placeholder, so that other effects can still be found.
void SampleLoop::look_behind_placeholder(Closure& closure) {
    const int most = options.samples.loop.most_placeholders;
    const State without = now_;
    const int first = next_id_;
    const std::optional<ResidualTest> left = closure.unexplained;
    const std::vector<ResidualTest> tests = closure.tests;
    const bool line = is_line(*nearest_->effect);
    std::vector<double> around_hz;
    for (int k = 0; k < most && nearest_ && is_line(*nearest_->effect) == line; ++k) {
        SampleChoice choice;
        choice.chosen = std::exchange(nearest_, {});
        take(choice, closure);
        around_hz.push_back(now_.added.back().hz);
        add_all(closure, line);
    }
    const bool of_witness = left && left->subject == followed_witnesses;
    // Lines near a placeholder are its residual of the unknown line; a rate may be part of the unknown rate; and a
    // motion may be part of a rate that follows an acceleration.
    const auto keeps = [&](const AddedEffect& added) {
        if (!line) return !is_slow_rate(added.effect()) && !(of_witness && is_motion(added.step.effect));
        if (!is_line(added.effect())) return !is_random_rate(added.effect());
        return std::none_of(around_hz.begin(), around_hz.end(),
                            [&](double hz) { return std::abs(hz - added.hz) < options.samples.lines.adjacent_hz; });
    };
    if (!keep_names(first, keeps, closure)) begin_again(without);
    closure.unexplained = left;
    closure.tests = tests;
}

/// Effects that were added from `first_id` on stay in the model, but those that `keeps` refuses are not reported.
/// \return whether any is reported
bool SampleLoop::keep_names(int first_id, const std::function<bool(const AddedEffect&)>& keeps, Closure& closure) {
    const auto since = [&](const AddedEffect& added) { return added.id >= first_id; };
    const auto stays = [&](const AddedEffect& added) { return since(added) && keeps(added); };
    if (std::none_of(now_.added.begin(), now_.added.end(), stays)) return false;
    for (std::size_t k = now_.added.size(); k-- > 0;) {
        if (!since(now_.added[k]) || stays(now_.added[k])) continue;
        closure.notes.push_back(
            fmt::format("{} was fitted only as a placeholder for structure that no effect of the library explains, "
                        "and is not reported",
                        now_.added[k].effect().name()));
        now_.added.erase(now_.added.begin() + static_cast<std::ptrdiff_t>(k));
    }
    return true;
}

/// Lines of the library keep their amplitude and, except for a drift, their frequency. A line that does not, as its
/// amplitude over time or another line next to it shows, is not reported. Changes of a strong line by a small share of
/// its power stay in the residual, and the line is reported.
void SampleLoop::take_back_lines(Closure& closure) {
    if (!closure.unexplained) return;
    const UnsteadyLine line = unsteady_line(*now_.fit);
    const double little = options.samples.loop.unsteady_line;
    const bool fails = line.off > little &&
                       of_several(line.p_value, static_cast<double>(closure.tests.size())) < options.level_of_residual;
    const bool adjacent = line.adjacent > little;
    if (!fails && !adjacent) return;
    for (std::size_t k = 0; k < now_.added.size(); ++k) {
        if (now_.added[k].id != line.step) continue;
        const std::string at = fmt::format("at {:.6g} Hz", line.hz);
        closure.unexplained = ResidualTest{adjacent ? Where::frequency : Where::amplitude,
                                           "a line that does not keep its amplitude or its frequency",
                                           fails ? line.p_value : closure.unexplained->p_value, at};
        closure.notes.push_back(fmt::format(
            "the line {} was fitted only so that other effects can be identified, and is not reported", at));
        now_.added.erase(now_.added.begin() + static_cast<std::ptrdiff_t>(k));
        return;
    }
}

}  // namespace ringlock::closure
