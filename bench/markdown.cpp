#include "markdown.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

namespace tubetrack::bench {

namespace {

std::string judged(double value, bool asked, bool met, double unit, int digits) {
  std::string text = number(value / unit, digits);
  if (asked && std::isfinite(value)) text += met ? " ✓" : " ✗";
  return text;
}

}  // namespace

std::string number(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, digits) : "–";
}

std::string bias(double value, int digits) {
  return std::isfinite(value) ? fmt::format("{:+.{}f}", value, digits) : "–";
}

std::string at_most(double value, double goal, double unit, int digits) {
  return judged(value, std::isfinite(goal), value <= goal, unit, digits);
}

std::string at_least(double value, double goal, double unit, int digits) {
  return judged(value, std::isfinite(goal), value >= goal, unit, digits);
}

std::string between(double value, double least, double most, double unit, int digits) {
  return judged(value, std::isfinite(least), value >= least && value <= most, unit, digits);
}

std::string compiler() {
#ifdef __clang__
  return "Clang " __clang_version__;
#else
  return "GCC " __VERSION__;
#endif
}

std::string MarkdownTable::text() const {
  std::string text = fmt::format("| {} |\n|", fmt::join(head_, " | "));
  for (std::size_t i = 0; i < head_.size(); ++i) text += i == 0 ? " --- |" : " ---: |";
  text += "\n";
  for (const auto& row : rows_) text += fmt::format("| {} |\n", fmt::join(row, " | "));
  return text;
}

}  // namespace tubetrack::bench
