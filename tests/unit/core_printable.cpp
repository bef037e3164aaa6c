#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"

namespace core_printable_test {
namespace {

using ringlock::json_text;
using ringlock::markdown;
using ringlock::printable;
using ringlock::without_controls;

TEST(Printable, LettersOfAnyAlphabetStay) {
    const std::string text = "gyro µ-Bogen Ω 角速度 \xf0\x9f\x9b\xb0 a\\b \"q\" <x>";
    EXPECT_EQ(printable(text), text);
}

TEST(Printable, WhatControlsATerminalIsWrittenOut) {
    EXPECT_EQ(printable("a\x1b[2J\r\n\t\x7f"), "a\\x1b[2J\\x0d\\x0a\\x09\\x7f");
    EXPECT_EQ(printable("\xc2\x9b"
                        "2J"),
              "\\u009b2J")
        << "CSI of C1";
    EXPECT_EQ(printable("\xe2\x80\xaegnp\xe2\x81\xa6"), "\\u202egnp\\u2066") << "override and isolate";
    EXPECT_EQ(printable("\xe2\x80\xa8"), "\\u2028") << "separator of lines";
    EXPECT_EQ(printable(std::string("\0", 1)), "\\x00");
}

TEST(Printable, BytesThatAreNoUtf8AreWrittenOut) {
    EXPECT_EQ(printable("a\xff\xc0\x80z"), "a\\xff\\xc0\\x80z") << "overlong";
    EXPECT_EQ(printable("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "surrogate";
    EXPECT_EQ(printable("\xe2\x82"), "\\xe2\\x82") << "cut off";
    EXPECT_EQ(printable("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond U+10FFFF";
}

TEST(Printable, AMessageKeepsItsOwnLines) { EXPECT_EQ(without_controls("one\n\ttwo \x1b[1m"), "one\n\ttwo \\x1b[1m"); }

TEST(Printable, OnceIsAsGoodAsTwice) {
    const std::string once = printable("\x1b\n\xff\xe2\x80\xae");
    EXPECT_EQ(printable(once), once);
}

TEST(Printable, MarkdownHasNoMarkup) {
    EXPECT_EQ(markdown("<script>|[a](b)`*\n"), "&lt;script&gt;\\|\\[a\\](b)\\`\\*\\\\x0a");
}

TEST(JsonText, AnyBytesMakeJson) {
    const std::string hostile = "a\xff\x1b\n\x7f\xc2\x9b\xe2\x80\xae\xf3\xa0\x80\x81z";
    const std::string text = json_text(nlohmann::json{{hostile, hostile}});
    for (const char c : text) EXPECT_GE(static_cast<unsigned char>(c), 0x20) << text;
    EXPECT_EQ(text.find('\x7f'), std::string::npos);
    EXPECT_EQ(text.find("\xc2\x9b"), std::string::npos);
    EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos);
    const nlohmann::json back = nlohmann::json::parse(text);
    EXPECT_EQ(back.begin().value(), "a\xef\xbf\xbd\x1b\n\x7f\xc2\x9b\xe2\x80\xae\xf3\xa0\x80\x81z");
}

}  // namespace
}  // namespace core_printable_test
