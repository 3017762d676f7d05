#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scan_bytes.hpp"
#include "scan_readers.hpp"

namespace tubetrack {

namespace {

/// Semicolons, and commas where they part numbers, become blanks. A comma inside a word on a line that other characters
/// part is a decimal comma, and refused rather than guessed at.
void part_by_blanks(std::string& line, int number) {
  std::replace(line.begin(), line.end(), ';', ' ');
  if (line.find(',') == std::string::npos) return;
  std::string_view rest = line;
  std::vector<std::string_view> words;
  for (std::string_view word = next_word(rest); !word.empty(); word = next_word(rest)) words.push_back(word);
  for (const std::string_view word : words) {
    const std::size_t comma = word.find(',');
    if (words.size() > 1 && comma != std::string_view::npos && comma != 0 && comma + 1 < word.size()) {
      throw ScanRefusal{fmt::format("line {}: got {}, takes decimal points; export it without decimal commas", number,
                                    in_quotes(word))};
    }
  }
  std::replace(line.begin(), line.end(), ',', ' ');
}

std::vector<double> numbers_of(std::string_view line, int number, bool& is_heading) {
  std::vector<double> numbers;
  is_heading = false;
  while (true) {
    const std::string_view word = next_word(line);
    if (word.empty()) return numbers;
    const auto value = number_in(word);
    if (!value && numbers.empty()) {
      is_heading = true;
      return numbers;
    }
    if (!value) {
      throw ScanRefusal{fmt::format("line {}: column {}: got {}, takes a number; correct or export it again", number,
                                    numbers.size() + 1, in_quotes(word))};
    }
    numbers.push_back(*value);
  }
}

/// A normal is recognised by its length: the first three columns after the coordinates (columns 4–6, else 7–9, behind
/// a colour) that have length 1 on every line.
class NormalColumns {
 public:
  void look_at(const std::vector<double>& row) {
    for (std::size_t k = 0; k < 2; ++k) {
      const std::size_t first = 3 + 3 * k;
      if (row.size() < first + 3) {
        unit_[k] = false;
        continue;
      }
      const Eigen::Vector3d normal(row[first], row[first + 1], row[first + 2]);
      if (!(std::abs(normal.norm() - 1.0) < 0.02)) unit_[k] = false;
      rows_[k].push_back(normal.cast<float>());
    }
  }
  std::vector<Eigen::Vector3f> result() {
    for (std::size_t k = 0; k < 2; ++k) {
      if (unit_[k]) return std::move(rows_[k]);
    }
    return {};
  }

 private:
  std::array<bool, 2> unit_{true, true};
  std::array<std::vector<Eigen::Vector3f>, 2> rows_;
};

}  // namespace

RawSurface read_xyz(std::string_view bytes) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // of some editors; else the first point were a heading
  if (bytes.starts_with(kByteOrderMark)) bytes.remove_prefix(kByteOrderMark.size());
  TextCursor text(bytes);
  RawSurface surface;
  NormalColumns normals;
  std::size_t columns = 0;
  std::string_view view;
  std::string line;
  while (text.next_content(view, '#')) {
    line.assign(view.substr(0, view.find("//")));
    part_by_blanks(line, text.line());
    bool is_heading = false;
    const std::vector<double> row = numbers_of(line, text.line(), is_heading);
    if (is_heading && surface.points.empty()) continue;
    if (row.empty() && !is_heading) continue;
    if (row.size() == 1 && surface.points.empty() && columns == 0) continue;  // some programs begin with the count
    if (columns == 0 && row.size() >= 3) columns = row.size();
    if (row.size() < 3 || row.size() != columns) {
      throw ScanRefusal{fmt::format("line {}: got {} number(s), takes {}; correct the line, or it is no list of points",
                                    text.line(), row.size(), columns == 0 ? "x y z" : std::to_string(columns))};
    }
    surface.points.emplace_back(row[0], row[1], row[2]);
    normals.look_at(row);
  }
  if (surface.points.empty()) throw ScanRefusal{"has no line of three numbers; this is no list of points"};
  surface.normals = normals.result();
  if (columns > 3 && surface.normals.empty()) {
    surface.notes.push_back(
        fmt::format("columns 4 to {} are no normals (their length is not 1) and not used", columns));
  }
  return surface;
}

}  // namespace tubetrack
