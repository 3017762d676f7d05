#pragma once

#include <string>

#include "speed_run.hpp"

namespace tubetrack::bench {

/// What stands above the tables.
struct SpeedAbout {
  std::string command;
  std::string commit;
  std::string cpu;
  double peak_memory_mb = 0.0;  ///< of a run with tubetrack alone; 0: not measured
};

/// docs/performance.md.
std::string speed_page(const SpeedReport& report, const SpeedAbout& about);

/// What issue 4 asks for, what was measured, and whether it is enough (speed_goals.cpp).
std::string speed_goals(const SpeedReport& report, double peak_memory_mb);

// Its other tables (speed_tables.cpp).
std::string scenes_table(const SpeedReport& report);
std::string stages_table(const SpeedReport& report);
std::string first_table(const SpeedReport& report);
std::string rivals_table(const SpeedReport& report);
std::string growth_table(const std::vector<SpeedRow>& rows);
std::string threads_table(const std::vector<ThreadsRow>& rows);
std::string changes_table(const std::vector<SpeedRow>& rows);

/// How fast the time grows with the cells that change, above what the still scene (the first row) takes: the exponent
/// of a power of their number.
double changes_exponent(const std::vector<SpeedRow>& rows);

/// Median of the fit's time for 1,000 pixels on the tubes (`pixels_on_tubes`); NaN without tubes.
double fit_ms_per_1000_pixels(const SpeedRow& row);

/// What is asked of a scene's whole frame; NaN: nothing.
struct TimeGoal {
  double median_ms;
  double p99_ms;
};
TimeGoal time_goal(const SpeedRow& row);

}  // namespace tubetrack::bench
