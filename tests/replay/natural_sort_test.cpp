#include "natural_sort.hpp"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <string>
#include <vector>

namespace tubetrack {
namespace {

TEST(NaturalSort, NumbersCompareByValue) {
  std::vector<std::string> names = {"learn10.png", "learn9.png", "learn0.png", "a2b10", "a2b9", "a10b1", "learn.png"};
  std::sort(names.begin(), names.end(), natural_less);
  EXPECT_EQ(names, (std::vector<std::string>{"a2b9", "a2b10", "a10b1", "learn.png", "learn0.png", "learn9.png",
                                             "learn10.png"}));
}

TEST(NaturalSort, NumbersOfAnyLengthCompareByValue) {
  EXPECT_TRUE(natural_less("99999999999999999999999998", "99999999999999999999999999"));
  EXPECT_TRUE(natural_less("9", "100000000000000000000000000"));
}

TEST(NaturalSort, LeadingZerosDoNotCountButStillOrder) {
  EXPECT_TRUE(natural_less("f007", "f8"));
  EXPECT_TRUE(natural_less("f07", "f7"));
  EXPECT_FALSE(natural_less("f7", "f07"));
  EXPECT_TRUE(natural_less("f07a", "f7b"));
}

/// Names full of digits, zeros and separators, short enough to collide often.
rc::Gen<std::string> names() {
  return rc::gen::container<std::string>(rc::gen::elementOf(std::string("0019ab_.")));
}

TEST(NaturalSort, IsAStrictTotalOrder) {
  EXPECT_TRUE(rc::check("irreflexive, one of two, transitive", [] {
    const std::string a = *names();
    const std::string b = *names();
    const std::string c = *names();
    RC_ASSERT(!natural_less(a, a));
    RC_ASSERT(a == b || natural_less(a, b) != natural_less(b, a));
    if (natural_less(a, b) && natural_less(b, c)) RC_ASSERT(natural_less(a, c));
  }));
}

TEST(NaturalSort, CountersComeInCountingOrderWhateverTheirPadding) {
  EXPECT_TRUE(rc::check("frame_<n> sorts as n", [](unsigned a, unsigned b) {
    RC_PRE(a < b);
    const std::string pad_a(*rc::gen::inRange<std::size_t>(0, 4), '0');
    const std::string pad_b(*rc::gen::inRange<std::size_t>(0, 4), '0');
    RC_ASSERT(
        natural_less("frame_" + pad_a + std::to_string(a) + ".png", "frame_" + pad_b + std::to_string(b) + ".png"));
  }));
}

}  // namespace
}  // namespace tubetrack
