#pragma once
#include <string>
#include <utility>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan_run/run.hpp"
#include "analysis/record/series/series.hpp"
#include "app/allan/sampling.hpp"
#include "app/text_arguments.hpp"

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
struct AllanRequest : allan_run::Request {
    bool unit_is_of_file = false;  ///< --unit names the unit of the numbers as they stand in the file
    Sampling sampling;
    bool stream = false;
    record::SeriesRequest series;  ///< but for path, column and rate
};

/// Throws InputError.
AllanRequest allan_request(const AllanArguments& arguments);

}  // namespace ringlock::app
