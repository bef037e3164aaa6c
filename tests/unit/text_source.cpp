// Bytes of text files: unpacked, decoded, and those that are no text.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lzma.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "analysis/text/source/identify.hpp"
#include "analysis/text/source/lines.hpp"
#include "analysis/text/source/source.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/packed_text.hpp"

namespace ringlock::text {
namespace text_source_test {
namespace {

using test::message_of;
using test::packed;
using test::Packer;
using test::StringSource;
using testing::AllOf;
using testing::HasSubstr;
using namespace std::string_literals;

std::string read_all(const std::string& bytes, std::size_t piece = 1000) {
    const auto source = as_text(std::make_unique<StringSource>(bytes), "data");
    std::string out;
    std::vector<char> buffer(piece);
    while (const std::size_t got = source->read(buffer.data(), buffer.size())) out.append(buffer.data(), got);
    return out;
}

std::string numbers(std::size_t rows) {
    std::mt19937_64 engine(5);
    std::string text = "t,x\n";
    for (std::size_t i = 0; i < rows; ++i) text += std::to_string(i) + "," + std::to_string(engine() % 1000) + "\n";
    return text;
}

TEST(TextSource, PackedTextComesBack) {
    const std::string text = numbers(60000);
    for (const Packer packer : {Packer::gzip, Packer::xz, Packer::zstd}) {
        const std::string bytes = packed(text, packer);
        EXPECT_LT(bytes.size(), text.size());
        for (const std::size_t piece : {7U, 1000U, 1U << 20}) EXPECT_TRUE(read_all(bytes, piece) == text) << piece;
        EXPECT_TRUE(read_all(bytes + packed("more\n", packer)) == text + "more\n") << "two streams are one";
    }
    EXPECT_EQ(read_all(packed("1\n", Packer::gzip) + std::string(700, '\0')), "1\n") << "padding of gzip";
}

TEST(TextSource, DamageAndEarlyEndsAreNamed) {
    const std::string text = numbers(20000);
    for (const Packer packer : {Packer::gzip, Packer::xz, Packer::zstd}) {
        const std::string bytes = packed(text, packer);
        for (const std::size_t length : {bytes.size() / 3, bytes.size() - 1, std::size_t{20}}) {
            EXPECT_THAT(message_of<InputError>([&] { read_all(bytes.substr(0, length)); }),
                        AllOf(HasSubstr("data: is packed with"), HasSubstr("ends too early")))
                << static_cast<int>(packer) << " " << length;
        }
        std::string damaged = bytes;
        for (std::size_t i = 0; i < 40; ++i) damaged[damaged.size() / 2 + i] ^= 0x55;
        EXPECT_THAT(message_of<InputError>([&] { read_all(damaged); }),
                    AllOf(HasSubstr("data: is packed with"), testing::AnyOf(HasSubstr("damaged"), HasSubstr("early"))));
        EXPECT_THAT(message_of<InputError>([&] { read_all(bytes + "tail of another file"); }), HasSubstr("damaged"));
    }
}

TEST(TextSource, LargeWindowsAreRefused) {
    EXPECT_THAT(message_of<InputError>([] { read_all(test::packed_with_window("1\n", Packer::zstd, 27)); }),
                AllOf(HasSubstr("data: is packed with zstd"), HasSubstr("64 MB")));
    EXPECT_EQ(read_all(test::packed_with_window("1\n", Packer::zstd, 26)), "1\n");
    EXPECT_THAT(message_of<InputError>([] { read_all(test::packed_with_window("1\n", Packer::xz, 27)); }),
                AllOf(HasSubstr("data: is packed with xz"), HasSubstr("64 MB")));
    EXPECT_EQ(read_all(test::packed_with_window("1\n", Packer::xz, 26)), "1\n");
}

TEST(TextSource, Utf16ComesBackAsUtf8) {
    const std::string text = "t,x \xC2\xB5 \xE2\x82\xAC \xF0\x9D\x84\x9E\n1,2\n";
    for (const bool big : {false, true}) {
        for (const bool mark : {false, true}) {
            // Without a mark only text of few other characters can be told from binary.
            const std::string plain = mark ? text : numbers(40);
            EXPECT_EQ(read_all(test::utf16(plain, big, mark), 5), plain) << big << mark;
        }
        EXPECT_THAT(message_of<InputError>([&] { read_all(test::utf16("1\n2\n", big, true) + "x"); }),
                    AllOf(HasSubstr("data: is text in UTF-16"), HasSubstr("ends within a character")));
    }
    EXPECT_THAT(message_of<InputError>([] { read_all("\xff\xfe\x31\x00\x00\xdc\x0a\x00"s); }),
                AllOf(HasSubstr("character 3"), HasSubstr("surrogate")));
    EXPECT_EQ(read_all(packed(test::utf16("1\n2\n", false, true), Packer::gzip)), "1\n2\n");
    EXPECT_EQ(read_all("\xEF\xBB\xBF"
                       "1\n"),
              "1\n");
}

TEST(TextSource, OtherFilesAreCalledByTheirNames) {
    const std::vector<std::pair<std::string, std::string>> kinds = {
        {"PK\x03\x04\x14\0\x06\0\x08\0\0\0!\0[Content_Types].xml"s, "Office file"},
        {"PK\x03\x04\x14\0\0\0\0\0\0\0!\0\0\0\0\0\0\0\0\0\0\0\0\0\x05\0\0\0x.npy"s, ".npz"},
        {"PK\x03\x04 anything"s, "zip archive"},
        {"\x93NUMPY\x01\0v\0{'descr': '<f8'"s, "NumPy"},
        {"MATLAB 5.0 MAT-file, Platform: GLNXA64"s, "MATLAB"},
        {"#ROSBAG V2.0\n"s, "ROS bag"},
        {"\x89MCAP0\r\n"s, "MCAP"},
        {"SQLite format 3\0"s, "SQLite"},
        {"PAR1"s, "Parquet"},
        {"MDF     4.10"s, "MDF"},
        {"TDSm\x0e\0\0\0"s, "TDMS"},
        {"RIFF\x24\0\0\0WAVE"s, "wav"},
        {"\xd4\xc3\xb2\xa1\x02\0"s, "pcap"},
        {"%PDF-1.7\n"s, "PDF"},
        {"\x89PNG\r\n\x1a\n"s, "PNG"},
        {"\xff\xd8\xff\xe0"s, "JPEG"},
        {"\x7f"
         "ELF\x02"s,
         "ELF"},
        {"BZh91AY"s, "bzip2"},
        {"7z\xbc\xaf\x27\x1c\0"s, "7z"},
        {std::string(257, 'x') + "ustar\0"s, "tar archive"},
        {"\x89HDF\r\n\x1a\n"s, "HDF5"},
        {"<!DOCTYPE html>"s, "HTML"},
    };
    for (const auto& [bytes, said] : kinds) {
        EXPECT_THAT(message_of<InputError>([&] { read_all(bytes); }), AllOf(HasSubstr("data: is"), HasSubstr(said)));
    }
    EXPECT_THAT(message_of<InputError>([] { read_all(packed(packed("1\n", Packer::xz), Packer::gzip)); }),
                AllOf(HasSubstr("its unpacked content is packed with xz"), HasSubstr("unpack")));
    EXPECT_EQ(identify("1,2,3\n").kind, "");
    EXPECT_EQ(identify("").kind, "");
}

TEST(TextLines, EveryEndOfLineIsOne) {
    const auto lines_of = [](const std::string& bytes) {
        Lines lines(std::make_unique<StringSource>(bytes), "data");
        std::vector<std::string> out;
        for (std::string_view line; lines.next(line);) out.emplace_back(line);
        EXPECT_EQ(lines.number(), out.size());
        return out;
    };
    EXPECT_THAT(lines_of("a\nb\n\nc"), testing::ElementsAre("a", "b", "", "c"));
    EXPECT_THAT(lines_of("a\r\nb\r\n"), testing::ElementsAre("a\r", "b\r"));
    EXPECT_THAT(lines_of("a\rb\rc"), testing::ElementsAre("a", "b", "c"));
    EXPECT_THAT(lines_of(""), testing::ElementsAre());
    EXPECT_THAT(message_of<InputError>([&] { lines_of("a\nb\0c\n"s); }),
                AllOf(HasSubstr("data:2:"), HasSubstr("zero byte")));
    EXPECT_THAT(message_of<InputError>([&] { lines_of(std::string(5 << 20, 'x')); }), HasSubstr("longer than"));
}

/// Gives a text in pieces of random length, as a pipe does.
class Pieces final : public Source {
   public:
    Pieces(std::string text, std::size_t longest, std::mt19937_64& random)
        : text_(std::move(text)), longest_(longest), random_(random) {}
    std::size_t read(char* to, std::size_t size) override {
        const std::size_t count = std::min({size, 1 + random_() % longest_, text_.size() - given_});
        text_.copy(to, count, given_);
        given_ += count;
        return count;
    }

   private:
    std::string text_;
    std::size_t longest_;
    std::mt19937_64& random_;
    std::size_t given_ = 0;
};

// The buffer grows with the bytes that come: lines of every length around its sizes come back whole.
TEST(TextLines, ComeBackWholeFromPiecesOfAnyLength) {
    std::mt19937_64 random(11);
    for (const std::size_t longest_line : {3U, 300U, 9000U, 70000U, 600000U}) {
        for (const std::size_t longest_piece : {5U, 4096U, 8192U, 1U << 20}) {
            if (longest_piece < 100 && longest_line > 1000) continue;  // takes long and shows nothing more
            std::vector<std::string> wanted;
            std::string text;
            while (text.size() < std::max<std::size_t>(20000, 3 * longest_line)) {
                wanted.emplace_back(1 + random() % longest_line, static_cast<char>('a' + wanted.size() % 26));
                text += wanted.back() + '\n';
            }
            Lines lines(std::make_unique<Pieces>(text, longest_piece, random), "data");
            std::vector<std::string> found;
            for (std::string_view line; lines.next(line);) found.emplace_back(line);
            EXPECT_TRUE(found == wanted) << longest_line << " " << longest_piece;
        }
    }
}

}  // namespace
}  // namespace text_source_test
}  // namespace ringlock::text
