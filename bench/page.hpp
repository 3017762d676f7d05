#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "run.hpp"

namespace tubetrack::bench {

/// What stands above the tables.
struct About {
  std::string command;
  std::string commit;
  std::string cpu;
  std::string suite;
  std::uint64_t first_seed = 0;
  double bound_piece_diameters = 1.0;
  int jobs = 1;
};

/// A row by every method; the first is tubetrack.
struct RowReport {
  Row row;
  std::vector<RowResult> by_method;
};

/// Single frames with some parts of the noise.
struct AblationStep {
  std::string noise;
  Figures figures;
};

struct Report {
  About about;
  std::vector<std::string> methods;
  std::vector<RowReport> rows;
  std::vector<AblationStep> ablation;
};

/// docs/accuracy.md.
std::string page(const Report& report);
/// docs/intervals.md.
std::string intervals_page(const Report& report);
/// A title, and how the page was made.
std::string page_head(const char* title, const Report& report);

// Its tables (page_tables.cpp).
std::string goals_table(const Report& report);
std::string rows_table(const Report& report);
std::string single_table(const Report& report);
std::string sequence_table(const Report& report);
std::string last_table(const Report& report);
std::string interval_table(const Report& report);
std::string bins_table(const Report& report);
std::string confidence_table(const Report& report);
std::string peers_table(const Report& report);
std::string time_table(const Report& report);
std::string ablation_table(const Report& report);

}  // namespace tubetrack::bench
