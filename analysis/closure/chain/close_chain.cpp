#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "analysis/closure/chain.hpp"
#include "analysis/closure/chain/record_in_chain.hpp"
#include "analysis/closure/chain/shared_rate.hpp"
#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/declared/declared_reader.hpp"
#include "analysis/closure/samples/loop/contest.hpp"
#include "analysis/closure/samples/model/source.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/error.hpp"

namespace ringlock::closure {

namespace {

/// A source adds two parameters, its rate and its phase, apart from the error of interpolated readings.
double p_of_source(double gain) { return chi2_tail(2.0 * gain, 2); }

/// Rates that the records found, the most precise first: it represents others of the same pattern.
std::vector<double> found_by(std::vector<std::unique_ptr<RecordInChain>>& records) {
    std::vector<RateEstimate> found;
    for (const auto& record : records) {
        if (!record->resampled()) continue;
        const Estimate rate = record->found_rate();
        found.push_back({rate.value, rate.sd});
    }
    std::stable_sort(found.begin(), found.end(),
                     [](const RateEstimate& a, const RateEstimate& b) { return a.sd_hz < b.sd_hz; });
    std::vector<double> hz;
    for (const RateEstimate& rate : found) hz.push_back(rate.hz);
    return hz;
}

/// Compares each record with the most likely rate, the `k`th of those that were tried.
void hold_against(std::size_t k, const std::vector<double>& rates_hz,
                  std::vector<std::unique_ptr<RecordInChain>>& records, Chain& chain) {
    for (std::size_t r = 0; r < records.size(); ++r) {
        RecordInChain& record = *records[r];
        ChainRecord& said = chain.records[r];
        const std::vector<double>& all = record.log_likelihood();
        const auto best = std::max_element(all.begin(), all.end());
        if (*best > record.log_likelihood_without())
            said.likeliest_hz = rates_hz[static_cast<std::size_t>(best - all.begin())];
        const double most = std::max(*best, record.log_likelihood_without());
        said.gain_of_shared = all[k] - record.log_likelihood_without();
        said.gain_alone = most - all[k];
        // The most likely of the other rates, and of the model without a source, was taken.
        said.p_alone = said.gain_alone > 0.0 ? p_of_wrong(said.gain_alone, all.size()) : 1.0;
        said.contradicts = of_several(said.p_alone, static_cast<double>(records.size())) < options.level_of_effects;
        const bool found = record.resampled() && same_source(record.found_hz(), rates_hz[k], record.rate_hz());
        if (!found && !passes_on_samples(p_of_source(said.gain_of_shared))) continue;
        const Estimate own = record.near(k);
        if (own.sd > 0.0 && std::isfinite(own.sd)) said.near_shared = RateEstimate{own.value, own.sd};
    }
}

/// Writes the rate that all records share into the report of each.
void report_shared(std::vector<std::unique_ptr<RecordInChain>>& records, Chain& chain) {
    const auto showing = std::count_if(chain.records.begin(), chain.records.end(),
                                       [](const ChainRecord& record) { return record.near_shared.has_value(); });
    KnownSource source{chain.shared->hz, chain.shared->sd_hz, 1.0, chain.tied_hz()};
    for (std::size_t r = 0; r < records.size(); ++r) {
        ChainRecord& said = chain.records[r];
        if (!said.near_shared) {
            said.closure.notes.push_back(
                fmt::format("the source of {:.8g} Hz, which other records of the data chain show, "
                            "explains this record no better than chance",
                            source.from_hz));
            continue;
        }
        source.p_value = p_of_source(said.gain_of_shared);
        said.closure = records[r]->report_with(source);
        const bool has = std::any_of(said.closure.steps.begin(), said.closure.steps.end(),
                                     [&](const Step& step) { return step.effect == chain.effect; });
        std::string note = fmt::format(
            "the rate of the source is taken from the data chain, in which {} records show it, "
            "and is held fixed for this record",
            showing);
        if (showing == 1)
            note =
                "no other record of the data chain shows the source: its rate is held at the estimate "
                "from this record alone";
        if (!has) {
            note = fmt::format(
                "with the source of {:.8g} Hz, which other records of the data chain show, "
                "{} was not added to the model of this record",
                source.from_hz, chain.effect->name());
        }
        said.closure.notes.push_back(std::move(note));
    }
}

}  // namespace

bool Chain::contradicted() const {
    return p_value < options.level_of_effects ||
           std::any_of(records.begin(), records.end(), [](const ChainRecord& record) { return record.contradicts; });
}

std::vector<double> Chain::tied_hz() const {
    std::vector<double> tied;
    for (const ChainRate& rate : rates) {
        if (rate.tied) tied.push_back(rate.hz);
    }
    std::sort(tied.begin(), tied.end());
    return tied;
}

void refuse_no_chain(std::span<const NamedRecord> records) {
    if (records.size() < 2) {
        throw InputError(fmt::format(
            "a data chain needs two or more records of one box, but there {} {}; name the other records too",
            records.size() == 1 ? "is" : "are", records.size()));
    }
    std::vector<double> rates_hz;
    for (const NamedRecord& of : records) {
        if (of.record->turns || !of.record->samples) {
            throw InputError(fmt::format(
                "{}: is a record of turns, each with its own time, and a data chain does not resample turns; "
                "the records of one data chain must be records of samples. Read this one by itself",
                of.name));
        }
        std::string note;
        rates_hz.push_back(summed_for_reader(*of.record, note).samples->rate_hz);
        const double rate_hz = of.record->samples->rate_hz;
        const double first_hz = records.front().record->samples->rate_hz;
        if (rate_hz != first_hz) {
            throw InputError(fmt::format(
                "{}: has {:.10g} samples a second and {} has {:.10g}; all records "
                "of one data chain must have the same rate. Name records of one rate, or read this one by itself",
                of.name, rate_hz, records.front().name, first_hz));
        }
        if (rates_hz.back() != rates_hz.front()) {
            throw InputError(fmt::format(
                "{}: the reader that it declares asks for sums at {:.10g} Hz, that of {} at {:.10g} Hz; all records "
                "of one data chain must have the same rate. Name records of one reader, or read this one by itself",
                of.name, rates_hz.back(), records.front().name, rates_hz.front()));
        }
    }
}

Chain close_chain(std::span<const NamedRecord> named, const Monitor& monitor) {
    refuse_no_chain(named);
    Chain chain;
    std::vector<std::unique_ptr<RecordInChain>> records;
    for (const NamedRecord& of : named) {
        RecordInChain& record = *records.emplace_back(std::make_unique<RecordInChain>(of, monitor));
        ChainRecord& said = chain.records.emplace_back();
        said.name = of.name;
        said.closure = record.alone();
        if (!record.resampled()) continue;
        said.alone_hz = record.found_rate().value;
        said.alone_other_hz = record.other_hz();
        chain.effect = first_that_shows(OnSamples::transport);
    }
    chain.record_rate_hz = records.front()->rate_hz();
    if (chain.effect == nullptr) return chain;
    RateTable table;
    table.record_rate_hz = chain.record_rate_hz;
    table.hz = rates_of_patterns(found_by(records), chain.record_rate_hz);
    for (const auto& record : records) {
        record->try_rates(table.hz);
        table.log_likelihood.push_back(record->log_likelihood());
    }
    chain.rates = ranked(table);
    const double likeliest_hz = chain.rates.front().hz;
    const auto k =
        static_cast<std::size_t>(std::find(table.hz.begin(), table.hz.end(), likeliest_hz) - table.hz.begin());
    monitor.tell("comparing the records");
    hold_against(k, table.hz, records, chain);
    std::vector<RateEstimate> own;
    for (const ChainRecord& record : chain.records) {
        if (record.near_shared) own.push_back(*record.near_shared);
    }
    const SharedRate shared = shared_of(own);
    chain.chi2 = shared.chi2;
    chain.freedom = shared.freedom;
    chain.p_value = shared.p_value;
    if (own.empty() || chain.contradicted()) return chain;
    chain.shared = shared.mean;
    report_shared(records, chain);
    return chain;
}

}  // namespace ringlock::closure
