#pragma once
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/sums/phase.hpp"
#include "analysis/quantity/unit.hpp"
#include "analysis/record/series/series.hpp"
#include "app/allan/output/coefficient_table.hpp"
#include "app/allan/sampling.hpp"
#include "app/allan/taus.hpp"
#include "app/text_arguments.hpp"
#include "app/wrap_argument.hpp"

namespace ringlock::app {

/// The command line of `ringlock allan` as it was typed.
struct AllanArguments {
    std::vector<std::string> data;
    std::string rate;
    std::string tau0;
    std::string kind;
    std::string unit;
    std::string scale;
    std::string arw_unit;
    std::string column;
    std::string dev = "oadev";
    std::string tau = "octave";
    double confidence = allan::Options{}.confidence;
    std::string bias = "published";
    std::string time;
    TextArguments text;
    std::string plot;
    std::string csv;
    std::vector<std::string> psd;
    std::string psd_method = "welch";
    std::string psd_sides = "two";
    std::string dynamic;
    std::vector<std::string> maps;
    std::vector<std::pair<std::string, std::string>> exports;  ///< format and file
    std::string wrap = "off";
    bool clean = false;
    bool hat = false;
    bool explain = false;
    bool follow_links = false;
    bool stream = false;
    bool json = false;
};

/// The same, checked, as far as it can be before a file is read.
struct AllanRequest {
    allan::Kind kind = allan::Kind::phase;
    std::string kind_name;
    std::optional<quantity::Unit> unit;
    bool unit_is_of_file = false;  ///< --unit names the unit of the numbers as they stand in the file
    const WalkUnit* walk_unit = nullptr;
    std::vector<allan::Estimator> estimators;
    TauChoice taus;
    allan::Options options;  ///< confidence and bias
    Sampling sampling;
    WrapChoice wrap;
    bool clean = false;  ///< deviations, too, are of the data without outliers, jumps, wraps and disturbed stretches
    bool stream = false;
    record::SeriesRequest series;  ///< but for path, column and rate

    double scale() const { return unit ? unit->factor : 1.0; }
};

/// Throws InputError.
AllanRequest allan_request(const AllanArguments& arguments);

}  // namespace ringlock::app
