// Files of MATLAB 5, whose elements are put together at random and whose bytes are damaged then, before they are packed
// or after: `fuzz_mat SEED COUNT [FIRST]`.
#include <zlib.h>

#include <cstdint>
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace ringlock;
using fuzz::Chance;

/// Writes elements in one of the two byte orders ("MAT-File Format", The MathWorks).
class Elements {
   public:
    Elements(Chance& chance, bool big) : chance_(chance), big_(big) {}

    std::string word(std::uint64_t number, std::size_t bytes = 4) const {
        std::string out;
        for (std::size_t i = 0; i < bytes; ++i) {
            out += static_cast<char>((number >> (8 * (big_ ? bytes - 1 - i : i))) & 0xffU);
        }
        return out;
    }
    std::string element(std::uint32_t type, const std::string& content) {
        const std::uint64_t claimed = chance_.one_in(40) ? chance_.any(1U << 31U) : content.size();
        if (content.size() <= 4 && chance_.one_in(2)) {
            return word(claimed << 16U | type) + content + std::string(4 - content.size(), '\0');
        }
        return word(type) + word(claimed) + content + std::string((8 - content.size() % 8) % 8, '\0');
    }

    std::string variable(const std::string& name, int depth = 0) {
        static const std::vector<std::uint32_t> classes = {6,  6,  6, 7, 8, 9, 10, 11, 12, 13,
                                                           14, 15, 1, 2, 3, 4, 5,  16, 0};
        const std::uint32_t of = chance_.of(classes);
        const std::uint64_t flags = (chance_.one_in(10) ? chance_.any(16) << 8U : 0) | of;
        static const std::vector<std::vector<std::uint32_t>> all_sides = {
            {4, 1}, {4, 1}, {1, 4},    {2, 2},         {4, 2},          {0, 3},
            {1, 1}, {4},    {2, 2, 2}, {65536, 65536}, {0xffffffff, 1}, {}};
        const std::vector<std::uint32_t>& sides = chance_.of(all_sides);
        std::string of_sides;
        std::size_t count = 1;
        for (const std::uint32_t side : sides) {
            of_sides += word(side);
            count = side > 16 ? 16 : count * side;
        }
        std::string body = element(6, word(flags) + word(chance_.any(3))) + element(5, of_sides) + element(1, name);
        if (of == 1 && depth < 3) {
            for (std::size_t i = 0; i < count; ++i) body += variable("", depth + 1);
        } else if (of == 2 && depth < 3) {
            body += element(5, word(chance_.one_in(5) ? chance_.any(64) : 8)) +
                    element(1, std::string("x\0\0\0\0\0\0\0y\0\0\0\0\0\0\0", 16));
            for (std::size_t i = 0; i < 2 * count; ++i) body += variable("", depth + 1);
        } else if (of == 5) {
            body += element(5, word(0) + word(1)) + element(5, word(0) + word(chance_.any(4)) + word(2));
            body += numbers(9, 2);
        } else {
            static const std::vector<std::uint32_t> types = {9, 9, 9, 7, 1, 2, 3, 4, 5, 6, 12, 13, 14, 16, 17, 0};
            body += numbers(chance_.of(types), count);
            if ((flags & 0x800U) != 0) body += numbers(9, count);
        }
        return element(14, body);
    }

   private:
    std::string numbers(std::uint32_t type, std::size_t count) {
        static const std::vector<std::size_t> sizes = {0, 1, 1, 2, 2, 4, 4, 4, 0, 8, 0, 0, 8, 8, 0, 0, 1, 2};
        if (chance_.one_in(20)) count = chance_.any(9);
        std::string content;
        for (std::size_t i = 0; i < count * sizes[type]; ++i) content += static_cast<char>(i % 8 < 6 ? i : 0x3f);
        return element(type, content);
    }

    Chance& chance_;
    bool big_;
};

std::string zipped(const std::string& text) {
    z_stream stream{};
    deflateInit2(&stream, 1, Z_DEFLATED, 12, 1, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, static_cast<uLong>(text.size())) + 16, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = static_cast<uInt>(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

std::string mat_file(Chance& chance) {
    const bool big = chance.one_in(4);
    Elements elements(chance, big);
    std::string all = "MATLAB 5.0 MAT-file, Platform: GLNXA64";
    all.resize(124, ' ');
    all += elements.word(0x0100, 2) + (big ? "MI" : "IM");
    static const std::vector<std::string> names = {"x", "x", "t", "a_long_name", "", "\x1b[2J"};
    for (std::size_t n = 1 + chance.any(3); n > 0; --n) {
        std::string variable = elements.variable(chance.of(names));
        if (chance.one_in(3)) variable = fuzz::damaged(variable, 1, chance);
        if (chance.one_in(2)) {
            const std::string packed = zipped(variable);
            variable = elements.word(15) + elements.word(packed.size()) + packed;
        }
        all += variable;
    }
    return all;
}

}  // namespace

int main(int argc, char** argv) {
    const auto one = [](Chance& chance, fuzz::InputFile& file, fuzz::Tally& tally) {
        file.write(fuzz::damaged(mat_file(chance), chance.one_in(2) ? 0 : 1 + chance.any(2), chance));
        record::SeriesRequest request;
        request.path = file.path();
        static const std::vector<std::string> columns = {"x", "x", "x", "x[:,0]", "x[0,:]", "t", "a_long_name"};
        if (!chance.one_in(4)) request.column = chance.of(columns);
        if (chance.one_in(6)) {
            request.time = std::string("t");
            request.rate_hz = 100.0;
        }
        fuzz::attempt(
            file.path(), [&] { record::read_series(request); }, tally);
    };
    return fuzz::run({"fuzz_mat", one, {"libmatio", "libhdf5", "libz.so"}}, {argv + 1, argv + argc});
}
