// Arrays of NumPy, alone and in archives, whose heads are put together at random and whose bytes are damaged then:
// `fuzz_npy SEED COUNT [FIRST]`.
#include <zlib.h>

#include <cstdint>
#include <string>
#include <vector>

#include "analysis/record/series/series.hpp"
#include "tests/fuzz/fuzz.hpp"
#include "tests/support/array_files.hpp"

namespace {

using namespace ringlock;
using fuzz::Chance;

std::string type_of_npy(Chance& chance) {
    static const std::vector<std::string> simple = {"'<f8'", "'<f8'", "'>f8'",          "'<f4'",     "'<f2'", "'<i8'",
                                                    "'>i4'", "'|i1'", "'<u8'",          "'>u2'",     "'|b1'", "'<c16'",
                                                    "'|O'",  "'<U3'", "'|S5'",          "'<M8[ns]'", "'|V7'", "'<f16'",
                                                    "'<f'",  "''",    "'<i99999999999'"};
    if (!chance.one_in(3)) return chance.of(simple);
    std::string fields;
    static const std::vector<std::string> names = {"'x'", "'t'", "'a b'", "'x'", "''", "'\\'q'"};
    static const std::vector<std::string> tails = {"", "", "", ", (3,)", ", (2, 2)", ", 4", ", (0,)", ", (99999999,)"};
    for (std::size_t n = chance.any(4); n > 0; --n) {
        fields += "(" + chance.of(names) + ", " + chance.of(simple) + chance.of(tails) + "), ";
    }
    return "[" + fields + "]";
}

std::string shape_of_npy(Chance& chance) {
    static const std::vector<std::string> shapes = {"(4,)",
                                                    "(4,)",
                                                    "(3,)",
                                                    "(4, 2)",
                                                    "(2, 4)",
                                                    "(1, 4)",
                                                    "(4, 1)",
                                                    "()",
                                                    "(0,)",
                                                    "(0, 3)",
                                                    "(2, 2, 2)",
                                                    "(1000000000000,)",
                                                    "(4294967296, 4294967296)",
                                                    "(18446744073709551615,)",
                                                    "(-1,)",
                                                    "(4,",
                                                    "4",
                                                    "(4L,)",
                                                    "('a',)",
                                                    "((((((((((((((((((4,),),),),),),),),),),),),),),),),),)"};
    return chance.of(shapes);
}

/// An array whose head and data may contradict each other; one in three is whole.
std::string array(Chance& chance) {
    if (chance.one_in(3)) {
        static const std::vector<std::string> types = {"'<f8'",
                                                       "'>f8'",
                                                       "'<f4'",
                                                       "'<i8'",
                                                       "'>u2'",
                                                       "'|b1'",
                                                       "'<f2'",
                                                       "[('x', '<f8'), ('t', '<f8')]",
                                                       "[('x', '<i4', (3,))]"};
        static const std::vector<std::string> shapes = {"(4,)", "(4, 1)", "(2, 2)", "(2, 3)"};
        const std::string head = test::npy_dictionary(chance.of(types), chance.of(shapes), chance.one_in(2));
        return test::npy(head, std::string(6 * 16, '\1'), static_cast<char>(1 + chance.any(3)));
    }
    std::string head = test::npy_dictionary(type_of_npy(chance), shape_of_npy(chance), chance.one_in(3));
    if (chance.one_in(8)) head = fuzz::damaged(head, 1, chance);
    std::string data;
    static const std::vector<std::size_t> sizes = {32, 32, 64, 24, 16, 8, 4, 0, 96, 200};
    for (std::size_t n = chance.of(sizes); n > 0; --n) data += static_cast<char>(n % 8 < 6 ? n : 0x3f);
    return test::npy(head, data, static_cast<char>(chance.one_in(20) ? chance.any(5) : 1 + chance.any(3)));
}

std::string little(std::uint64_t number, std::size_t bytes) {
    std::string out;
    for (; bytes > 0; --bytes, number >>= 8U) out += static_cast<char>(number & 0xffU);
    return out;
}

std::string deflated(const std::string& text) {
    z_stream stream{};
    constexpr int raw = -12;
    deflateInit2(&stream, 1, Z_DEFLATED, raw, 1, Z_DEFAULT_STRATEGY);
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

/// An archive (APPNOTE.TXT of PKWARE): entries, then the directory of them, then its end. Its sizes may be wrong.
std::string zip(Chance& chance) {
    static const std::vector<std::string> names = {"x.npy", "t.npy",  "x.npy",       "a/b.npy",
                                                   ".npy",  "readme", "\xff\x1b.npy"};
    std::string all;
    std::string directory;
    std::size_t count = 1 + chance.any(3);
    const std::size_t entries = count;
    for (; count > 0; --count) {
        const std::string content = chance.one_in(10) ? std::string("no array") : array(chance);
        const bool packed = chance.one_in(2);
        const std::string stored = packed ? deflated(content) : content;
        const std::string& name = chance.of(names);
        const auto wrong = [&](std::uint64_t size) { return chance.one_in(15) ? chance.any(1U << 31U) : size; };
        const std::uint64_t flags = chance.one_in(10) ? chance.any(16) : 0;
        const std::uint64_t crc =
            crc32(0, reinterpret_cast<const Bytef*>(content.data()), static_cast<uInt>(content.size()));
        const std::string common = little(20, 2) + little(flags, 2) + little(packed ? 8 : 0, 2) + little(0, 4) +
                                   little(wrong(crc), 4) + little(wrong(stored.size()), 4) +
                                   little(wrong(content.size()), 4) + little(name.size(), 2) + little(0, 2);
        directory +=
            "PK\x01\x02" + little(20, 2) + common + little(0, 2 + 2 + 2 + 4) + little(wrong(all.size()), 4) + name;
        all += "PK\x03\x04" + common + name + stored;
    }
    const std::size_t at = all.size();
    all += directory + "PK\x05\x06" + little(0, 4) + little(entries, 2) + little(entries, 2) +
           little(directory.size(), 4) + little(at, 4) + little(0, 2);
    return all;
}

record::SeriesRequest array_request(const std::string& path, Chance& chance) {
    record::SeriesRequest request;
    request.path = path;
    static const std::vector<std::string> columns = {"x",   "x",     "[:,0]", "[1,:]", "x[:,1]",
                                                     "a/b", "arr_0", "x[:,",  "x/t",   "t"};
    if (!chance.one_in(3)) request.column = chance.of(columns);
    if (chance.one_in(5)) {
        static const std::vector<std::string> times = {"t", "x", "[:,0]", "t[:,0]"};
        request.time = chance.of(times);
        request.rate_hz = 100.0;
    }
    return request;
}

}  // namespace

int main(int argc, char** argv) {
    const auto one = [](Chance& chance, fuzz::InputFile& file, fuzz::Tally& tally) {
        const std::string whole = chance.one_in(3) ? zip(chance) : array(chance);
        file.write(fuzz::damaged(whole, chance.one_in(2) ? 0 : 1 + chance.any(2), chance));
        for (int i = 0; i < 2; ++i) {
            const record::SeriesRequest request = array_request(file.path(), chance);
            fuzz::attempt(
                file.path(), [&] { record::read_series(request); }, tally);
        }
    };
    return fuzz::run({"fuzz_npy", one, {"libarchive"}}, {argv + 1, argv + argc});
}
