#include "app/report/answer.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <optional>

#include "analysis/study/sensitivity.hpp"

namespace ringlock::app {

namespace {

using study::ArmSummary;
using study::Summary;

std::string interval_words(std::optional<double> lo, std::optional<double> hi, int digits = 3) {
    return lo && hi ? fmt::format(" (95 %: {:.{}g} to {:.{}g})", *lo, digits, *hi, digits) : "";
}

/// Arms that can be the answer and whose records show a random walk, the smallest first.
std::vector<const ArmSummary*> ranked(const Summary& summary) {
    std::vector<const ArmSummary*> arms;
    for (const ArmSummary& arm : summary.arms) {
        if (arm.name != "ideal" && arm.arw_deg_rt_h.median) arms.push_back(&arm);
    }
    std::stable_sort(arms.begin(), arms.end(), [](const ArmSummary* a, const ArmSummary* b) {
        return *a->arw_deg_rt_h.median < *b->arw_deg_rt_h.median;
    });
    return arms;
}

/// Arms whose random walk has an upper limit only.
std::vector<const ArmSummary*> limited(const Summary& summary) {
    std::vector<const ArmSummary*> arms;
    for (const ArmSummary& arm : summary.arms) {
        if (arm.name != "ideal" && !arm.arw_deg_rt_h.median && arm.arw_deg_rt_h.hi) arms.push_back(&arm);
    }
    return arms;
}

/// A ratio of two random walks, gyro by gyro.
struct Ratio {
    double value = 0.0;
    std::optional<double> lo, hi;
    bool distinguishable = false;
};

/// Random walk of `over` divided by that of `arm`; nothing where no gyro has both.
std::optional<Ratio> ratio_of(const Summary& summary, const std::string& over, const std::string& arm) {
    for (const study::ArmPair& pair : summary.pairs) {
        const lot::PairedFigure& figure = pair.arw_deg_rt_h.ratio;
        if (!figure.value) continue;
        const auto& interval = figure.interval;
        if (pair.first == over && pair.second == arm) {
            Ratio ratio{*figure.value, {}, {}, figure.distinguishable};
            if (interval) ratio.lo = interval->lo, ratio.hi = interval->hi;
            return ratio;
        }
        if (pair.first == arm && pair.second == over && *figure.value > 0.0) {
            Ratio ratio{1.0 / *figure.value, {}, {}, figure.distinguishable};
            if (interval && interval->lo > 0.0) ratio.lo = 1.0 / interval->hi, ratio.hi = 1.0 / interval->lo;
            return ratio;
        }
    }
    return std::nullopt;
}

/// Arms that the data do not distinguish from the smallest, itself first.
std::vector<std::string> tied_with_first(const Summary& summary, const std::vector<const ArmSummary*>& arms) {
    std::vector<std::string> tied{arms.front()->name};
    for (std::size_t i = 1; i < arms.size(); ++i) {
        const auto ratio = ratio_of(summary, arms[i]->name, arms.front()->name);
        if (!ratio || !ratio->distinguishable) tied.push_back(arms[i]->name);
    }
    return tied;
}

std::string walk_words(const ArmSummary& arm) {
    const study::Figure& arw = arm.arw_deg_rt_h;
    return fmt::format("{:.4g} deg/sqrt(h){}", *arw.median, interval_words(arw.median_lo, arw.median_hi));
}

std::string factor_words(const Summary& summary, const std::string& over, const std::string& arm) {
    const auto ratio = ratio_of(summary, over, arm);
    if (!ratio) return "";
    return fmt::format("{:.4g} times as large{}", ratio->value, interval_words(ratio->lo, ratio->hi, 4));
}

std::string and_list(const std::vector<std::string>& words) {
    if (words.size() < 2) return fmt::format("{}", fmt::join(words, ""));
    const std::vector<std::string> first(words.begin(), words.end() - 1);
    return fmt::format("{} and {}", fmt::join(first, ", "), words.back());
}

/// Whether the random walk of an arm with an upper limit may be the smallest.
bool may_be_smallest(const ArmSummary& arm, const ArmSummary& best) {
    const study::Figure& arw = best.arw_deg_rt_h;
    return *arm.arw_deg_rt_h.hi >= arw.median_lo.value_or(*arw.median);
}

std::string smallest_walk(const Summary& summary, const std::vector<const ArmSummary*>& arms) {
    const ArmSummary& best = *arms.front();
    if (arms.size() == 1) {
        return fmt::format("{} is the only arm whose angle random walk is resolved: {}.", best.name, walk_words(best));
    }
    const std::vector<std::string> tied = tied_with_first(summary, arms);
    const std::string& next = arms[1]->name;
    const std::string factor = factor_words(summary, next, best.name);
    std::string text;
    if (tied.size() > 1) {
        text = fmt::format("The data do not decide which of {} has the smallest angle random walk", and_list(tied));
        text += fmt::format(": the smallest median is that of {}, {}", best.name, walk_words(best));
        text += factor.empty() ? "." : fmt::format(", and the random walk of {} is {}.", next, factor);
    } else {
        text = fmt::format("{}{} has the smallest angle random walk, {}",
                           limited(summary).empty() ? "" : "Among the arms whose random walk is resolved, ", best.name,
                           walk_words(best));
        text += factor.empty() ? "." : fmt::format("; that of {}, the next, is {}.", next, factor);
    }
    const std::string reference = "noise_injected";
    const bool other = next != reference && best.name != reference;
    const std::string of_reference = other ? factor_words(summary, reference, best.name) : "";
    if (!of_reference.empty()) text += fmt::format(" That of {} is {}.", reference, of_reference);
    return text;
}

void add_limited(const Summary& summary, const std::vector<const ArmSummary*>& arms, std::vector<std::string>& out) {
    for (const ArmSummary* arm : limited(summary)) {
        const double limit = *arm->arw_deg_rt_h.hi;
        std::string text = fmt::format("The random walk of {} is not resolved: it is at most {:.3g} deg/sqrt(h) (95 %)",
                                       arm->name, limit);
        if (!arms.empty()) {
            const char* relation = may_be_smallest(*arm, *arms.front())
                                       ? "so that the data do not decide between it and"
                                       : "less than that of";
            text += fmt::format(", {} {}", relation, arms.front()->name);
        }
        out.push_back(fmt::format("{}; its mean rate error is {:.3g} deg/h.", text, arm->rate_error_deg_h.mean));
    }
}

/// Arms without a random walk have errors all the same.
void add_without_walk(const Summary& summary, std::vector<std::string>& out) {
    for (const ArmSummary& arm : summary.arms) {
        if (arm.name == "ideal" || study::has_arw(arm)) continue;
        const study::MeanFigure& error = arm.rate_error_deg_h;
        out.push_back(fmt::format(
            "{} has no random walk; its mean rate error is {:.3g} deg/h (68 % of the gyros: {:.3g} to {:.3g}).",
            arm.name, error.mean, error.lo, error.hi));
    }
}

void add_yields(const Summary& summary, std::vector<std::string>& out) {
    std::vector<std::string> parts;
    for (const ArmSummary& arm : summary.arms) {
        if (!arm.yield || !arm.yield->share.value || arm.name == "ideal") continue;
        const lot::Share& share = arm.yield->share;
        std::string part = fmt::format("{:.1f} % of the gyros of {}", 100.0 * *share.value, arm.name);
        if (share.interval) {
            part += fmt::format(" (95 %: {:.1f} to {:.1f})", 100.0 * share.interval->lo, 100.0 * share.interval->hi);
        }
        parts.push_back(part);
    }
    if (!parts.empty()) out.push_back(fmt::format("The specification is met by {}.", and_list(parts)));
}

/// Largest error of the mean rate over the sweep.
double largest_error_deg_h(const ArmSummary& arm) {
    double largest = 0.0;
    for (const study::SweepPoint& point : arm.sweep) {
        largest = std::max(largest, std::abs(point.output_rate_deg_h.mean - point.input_rate_deg_h));
    }
    return largest;
}

std::vector<std::string> sweep_answer(const Summary& summary) {
    std::vector<const ArmSummary*> arms;
    for (const ArmSummary& arm : summary.arms) {
        if (arm.name != "ideal") arms.push_back(&arm);
    }
    std::stable_sort(arms.begin(), arms.end(), [](const ArmSummary* a, const ArmSummary* b) {
        return largest_error_deg_h(*a) < largest_error_deg_h(*b);
    });
    std::vector<std::string> out;
    for (const ArmSummary* arm : arms) {
        const auto edge = study::locked_up_to_deg_h(*arm);
        out.push_back(fmt::format("The mean rate of {} is off by at most {:.3g} deg/h over the sweep; {}.", arm->name,
                                  largest_error_deg_h(*arm),
                                  edge ? fmt::format("its gyros are locked up to {:.4g} deg/h", *edge)
                                       : std::string("it is not locked at any of the rates")));
    }
    if (out.empty()) out.emplace_back("The data do not decide between cures: the study has the ideal gyro only.");
    return out;
}

std::string point_words(const study::Experiment& experiment, std::size_t point) {
    std::vector<std::string> values;
    for (const study::Axis& axis : experiment.axes) {
        values.push_back(fmt::format("{} = {:.5g}", axis.key, axis.values[point]));
    }
    return fmt::format("point {} ({})", point + 1, fmt::join(values, ", "));
}

/// The key with the largest index of total order for a figure of an arm.
std::string deciding_key(const study::Experiment& experiment, const std::string& arm,
                         const study::SensitiveFigure& figure) {
    const auto& factors = figure.indices.factors;
    if (!figure.indices.absent.empty() || factors.size() < 2) return "";
    std::vector<std::size_t> order(factors.size());
    for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
        return factors[a].total.estimate > factors[b].total.estimate;
    });
    const design::Index& first = factors[order[0]].total;
    const design::Index& second = factors[order[1]].total;
    const std::string& key = experiment.axes[order[0]].key;
    if (first.lo <= second.hi) {
        return fmt::format(
            "The data do not decide which key the {} of {} depends on most: the indices of total order of {} and {} "
            "are {:.2f} (95 %: {:.2f} to {:.2f}) and {:.2f} (95 %: {:.2f} to {:.2f}).",
            figure.name, arm, key, experiment.axes[order[1]].key, first.estimate, first.lo, first.hi, second.estimate,
            second.lo, second.hi);
    }
    return fmt::format("The {} of {} depends on {} most: index of total order {:.2f} (95 %: {:.2f} to {:.2f}).",
                       figure.name, arm, key, first.estimate, first.lo, first.hi);
}

}  // namespace

std::vector<std::string> study_answer(const study::Study&, const Summary& summary) {
    if (!summary.arms.front().sweep.empty()) return sweep_answer(summary);
    std::vector<std::string> out;
    const std::vector<const ArmSummary*> arms = ranked(summary);
    if (!arms.empty()) {
        out.push_back(smallest_walk(summary, arms));
    } else {
        out.emplace_back(
            "The data do not decide which arm has the smallest angle random walk: none is resolved in their records.");
    }
    add_limited(summary, arms, out);
    add_without_walk(summary, out);
    add_yields(summary, out);
    return out;
}

std::vector<std::string> design_answer(const study::Experiment& experiment, const std::vector<Summary>& summaries) {
    std::map<std::string, std::size_t> wins;
    std::size_t undecided = 0;
    const ArmSummary* smallest = nullptr;
    std::size_t smallest_at = 0;
    for (std::size_t p = 0; p < summaries.size(); ++p) {
        const std::vector<const ArmSummary*> arms = ranked(summaries[p]);
        if (arms.empty()) {
            ++undecided;
            continue;
        }
        if (smallest == nullptr || *arms.front()->arw_deg_rt_h.median < *smallest->arw_deg_rt_h.median) {
            smallest = arms.front();
            smallest_at = p;
        }
        if (tied_with_first(summaries[p], arms).size() > 1) {
            ++undecided;
        } else {
            ++wins[arms.front()->name];
        }
    }
    std::vector<std::string> parts;
    for (const auto& [arm, points] : wins) parts.push_back(fmt::format("{} at {}", arm, points));
    std::string first = fmt::format("Among {} points ", summaries.size());
    if (parts.empty()) {
        first += "the data decide at none which arm has the smallest angle random walk.";
    } else {
        first += fmt::format("the smallest angle random walk is that of {}", and_list(parts));
        first += undecided > 0 ? fmt::format("; at {} the data do not decide.", undecided) : ".";
    }
    std::vector<std::string> out{first};
    if (smallest != nullptr) {
        out.push_back(fmt::format("The smallest of all is {}, of {} at {}.", walk_words(*smallest), smallest->name,
                                  point_words(experiment, smallest_at)));
    }
    if (experiment.scenario.design.sensitivity_base_points > 0) {
        for (const study::ArmSensitivity& arm : study::sensitivity(experiment)) {
            for (const study::SensitiveFigure& figure : arm.figures) {
                const std::string sentence = deciding_key(experiment, arm.arm, figure);
                if (!sentence.empty() && arm.arm != "ideal") out.push_back(sentence);
            }
        }
    }
    return out;
}

}  // namespace ringlock::app
