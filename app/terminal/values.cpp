#include <map>
#include <string>
#include <vector>

#include "analysis/allan/estimator.hpp"
#include "app/terminal/command_line.hpp"
#include "engine/scenario/arm.hpp"

namespace ringlock::app {
namespace {

using Kind = Values::Kind;

std::vector<std::string> deviations() {
    std::vector<std::string> out;
    for (const allan::Traits& t : allan::all_estimators) out.emplace_back(t.name);
    return out;
}

/// By "COMMAND ARGUMENT", or by "ARGUMENT" where it means the same in all commands.
const std::map<std::string, Values>& all_values() {
    static const std::map<std::string, Values> all = {
        {"SCENARIO.toml", {"", Kind::file, {"toml"}}},
        {"OUT.h5", {"", Kind::file, {"h5"}}},
        {"FILE.h5", {"", Kind::file, {"h5"}}},
        {"FILE", {"", Kind::file}},
        {"DATA", {"", Kind::file}},
        {"RECORD", {"", Kind::file}},
        {"SHARD", {"", Kind::file}},
        {"INPUT", {"", Kind::file}},
        {"DEVICE", {"", Kind::device}},
        {"COMMAND", {"", Kind::command, {"scenario"}}},
        {"SHELL", {"", Kind::words, {"bash", "zsh", "fish"}}},
        {"--output", {"FILE", Kind::file}},
        {"run --output", {"OUT.h5", Kind::file, {"h5"}}},
        {"submit --output", {"OUT.h5", Kind::file, {"h5"}}},
        {"record --output", {"RECORD.h5", Kind::file, {"h5"}}},
        {"import --output", {"RECORD.h5", Kind::file, {"h5"}}},
        {"replay --output", {"REPLAY.h5", Kind::file, {"h5"}}},
        {"closure --output", {"DIR", Kind::folder}},
        {"new --output", {"FILE.toml", Kind::file, {"toml"}}},
        {"report --output", {"PAGE.html", Kind::file, {"html"}}},
        {"export --output", {"FILE", Kind::file, {"csv", "json", "mat", "npz"}}},
        {"--plot", {"FIGURE", Kind::file, {"svg", "png", "pdf"}}},
        {"--csv", {"FILE.csv", Kind::file, {"csv"}}},
        {"--psd", {"FILE", Kind::file, {"csv", "svg", "png", "pdf"}}},
        {"--map", {"FILE", Kind::file, {"csv", "svg", "png", "pdf"}}},
        {"--model", {"SCENARIO.toml", Kind::file, {"toml"}}},
        {"--set", {"KEY=VALUE", Kind::setting}},
        {"--seed", {"S"}},
        {"--threads", {"N"}},
        {"--gyro", {"N"}},
        {"--arm", {"ARM", Kind::words, scenario::arm_names()}},
        {"--dev", {"LIST", Kind::words, deviations()}},
        {"allan --tau", {"LIST", Kind::words, {"octave", "decade", "all"}}},
        {"--tau", {"LIST"}},
        {"--kind", {"KIND", Kind::words, {"phase", "increment", "rate"}}},
        {"allan --unit",
         {"UNIT",
          Kind::words,
          {"arcsec", "deg", "rad", "deg/h", "deg/s", "rad/s", "m/s", "m/s^2", "mg", "s", "ns", "counts"}}},
        {"import --unit", {"UNIT", Kind::words, {"arcsec", "deg", "rad", "deg/h", "deg/s", "rad/s", "counts"}}},
        {"--arw-unit",
         {"UNIT",
          Kind::words,
          {"deg/sqrt(h)", "deg/h/sqrt(Hz)", "deg/s/sqrt(Hz)", "rad/s/sqrt(Hz)", "m/s/sqrt(h)", "m/s^2/sqrt(Hz)",
           "ug/sqrt(Hz)"}}},
        {"allan --rate", {"HZ", Kind::words, {"file"}}},
        {"--rate", {"HZ"}},
        {"--tau0", {"TIME"}},
        {"--scale", {"S"}},
        {"allan --column", {"COLUMN"}},
        {"import --column", {"NAME=QUANTITY"}},
        {"--time", {"COLUMN"}},
        {"--time-unit", {"UNIT", Kind::words, {"s", "ms", "us", "ns", "iso", "mjd"}}},
        {"--header", {"WHICH", Kind::words, {"yes", "no"}}},
        {"--skip", {"N"}},
        {"--delimiter", {"D", Kind::words, {"comma", "semicolon", "tab", "space"}}},
        {"--bias", {"HOW", Kind::words, {"published", "exact", "raw"}}},
        {"--confidence", {"P"}},
        {"--wrap", {"WRAP", Kind::words, {"off", "auto"}}},
        {"--psd-method", {"METHOD", Kind::words, {"welch", "cosine"}}},
        {"--psd-sides", {"SIDES", Kind::words, {"two", "one"}}},
        {"--dynamic", {"TIME"}},
        {"--export", {"FORMAT FILE", Kind::words, {"kalibr", "matlab", "toml"}}},
        {"--declare", {"KEY=NUMBER"}},
        {"--print-schema", {"FORMAT", Kind::words, {"toml", "markdown", "json"}}},
        {"--checkpoint-every", {"S", Kind::words, {"never"}}},
        {"--shard", {"I/N"}},
        {"--shards-of", {"TIME"}},
        {"--table",
         {"NAME",
          Kind::words,
          {"gyros", "arms", "allan", "allan-gyros", "angle", "pairs", "points", "turns", "samples", "environment",
           "reference", "parameters", "residual", "scores", "attributes"}}},
        {"--only", {"PATH"}},
        {"man --all", {"DIR", Kind::folder}},
    };
    return all;
}

}  // namespace

Values values_of(const std::string& command, const std::string& argument) {
    const auto& all = all_values();
    const auto own = all.find(command + " " + argument);
    if (own != all.end()) return own->second;
    const auto shared = all.find(argument);
    return shared == all.end() ? Values{} : shared->second;
}

}  // namespace ringlock::app
