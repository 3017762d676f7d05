#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace tubetrack::bench {

/// Units of tables.
constexpr double kMm = 0.001, kPercent = 0.01;

/// A number with so many digits after the point; "–" where it is not defined.
std::string number(double value, int digits);
/// The same, with its sign even where it is positive.
std::string bias(double value, int digits);
/// The number and whether it is good enough; without a goal (NaN) only the number.
std::string at_most(double value, double goal, double unit, int digits);
std::string at_least(double value, double goal, double unit, int digits);
std::string between(double value, double least, double most, double unit, int digits);

/// The compiler of this program, with its version.
std::string compiler();

/// A table in Markdown.
class MarkdownTable {
 public:
  explicit MarkdownTable(std::vector<std::string> head) : head_(std::move(head)) {}
  void add(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }
  std::string text() const;

 private:
  std::vector<std::string> head_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace tubetrack::bench
