// Texts that are packed with gzip, xz or zstd, some of them in UTF-16, and damaged then:
// `fuzz_packed SEED COUNT [FIRST]`.
#include <string>
#include <vector>

#include "tests/fuzz/fuzz.hpp"
#include "tests/fuzz/texts.hpp"
#include "tests/support/packed_text.hpp"

namespace {

using namespace ringlock;

/// Each log in each packing, made once: packing takes longer than all that follows.
std::vector<std::string> packed_logs() {
    std::vector<std::string> all;
    for (const std::string& log : fuzz::logs) {
        const std::vector<std::string> encodings = {log, log, test::utf16(log, false, true),
                                                    test::utf16(log, true, false)};
        for (const std::string& text : encodings) {
            for (const auto packer : {test::Packer::gzip, test::Packer::xz, test::Packer::zstd}) {
                all.push_back(test::packed(text, packer));
            }
        }
        all.push_back(test::utf16(log, true, true));
    }
    const auto two = [](test::Packer packer) {
        return test::packed("t,gx\n0,1\n", packer) + test::packed("1,2\n", packer);
    };
    for (const auto packer : {test::Packer::gzip, test::Packer::xz, test::Packer::zstd}) all.push_back(two(packer));
    return all;
}

}  // namespace

int main(int argc, char** argv) {
    const std::vector<std::string> seeds = packed_logs();
    const auto one = [&](fuzz::Chance& chance, fuzz::InputFile& file, fuzz::Tally& tally) {
        file.write(fuzz::damaged(chance.of(seeds), chance.any(4), chance));
        fuzz::read_text(file, chance, tally);
    };
    return fuzz::run({"fuzz_packed", one}, {argv + 1, argv + argc});
}
