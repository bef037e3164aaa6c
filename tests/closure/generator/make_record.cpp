// make_record OUT.h5 turns|samples KEY=VALUE...: writes a record with known truth. Without keys lists them.
#include <cstdio>
#include <exception>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "tests/closure/generator/generator.hpp"
#include "tests/closure/generator/keys.hpp"
#include "tests/closure/generator/samples.hpp"

namespace {

using namespace ringlock;
using namespace ringlock::test::closure;

template <class T>
T truth_of(std::span<char*> arguments) {
    T truth;
    for (const std::string_view argument : arguments) {
        const std::size_t equals = argument.find('=');
        if (equals == std::string_view::npos) throw InputError("'" + std::string(argument) + "' is not KEY=VALUE");
        set(truth, argument.substr(0, equals), argument.substr(equals + 1));
    }
    return truth;
}

void list(const char* title, const std::vector<std::string>& keys) {
    std::fprintf(stderr, "%s:\n", title);
    for (const std::string& key : keys) std::fprintf(stderr, "  %s\n", key.c_str());
}

}  // namespace

int main(int argc, char** argv) {
    try {
        const std::string_view kind = argc > 2 ? argv[2] : "";
        if (kind != "turns" && kind != "samples") {
            std::fprintf(stderr, "usage: make_record OUT.h5 turns|samples KEY=VALUE...\n");
            list("turns", turn_keys());
            list("samples", sample_keys());
            return 2;
        }
        const std::span arguments(argv + 3, argv + argc);
        if (kind == "turns") {
            const Truth truth = truth_of<Truth>(arguments);
            record::write_record(argv[1], generate({&truth, 1}).front());
        } else {
            record::write_record(argv[1], generate_samples(truth_of<SampleTruth>(arguments)));
        }
    } catch (const InputError& error) {
        std::fprintf(stderr, "make_record: %s\n", error.what());
        return 2;
    } catch (const std::exception& error) {
        std::fprintf(stderr, "make_record: %s\n", error.what());
        return 1;
    }
}
