#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "paper_scans.hpp"

namespace tubetrack::bench {

/// Ours on one scan, and the paper's algorithms 1 and 2 transcribed. Seconds are processor time of one thread.
struct PaperRow {
  std::string name;
  std::size_t faces = 0;
  std::size_t tubes = 0;
  double ours_s = 0.0;  ///< surfels and all, the scan in memory
  double transcription_s = 0.0;
  double rms_voxels = 0.0;      ///< of the longest tube's line to the true centreline
  double found = 0.0;           ///< the length of all tubes over the true length
  double peak_memory_mb = 0.0;  ///< of the process so far
  double paper_s = 0.0;
  double goal_voxels = 0.0;
};

/// Without the transcription its time is not a number.
PaperRow measure(const PaperScan& scan, bool with_transcription);

/// Ours on a full mesh of so many faces, in a process of its own: what the heap keeps of another scan is then not in
/// its peak memory. Throws where that process fails.
PaperRow measure_alone(std::size_t faces);

std::string paper_rows_text(const std::vector<PaperRow>& rows);
std::string robustness_text(const std::vector<PaperRow>& rows);
/// Rows of growing scans, and the exponent of the time in the faces.
std::string growth_text(const std::vector<PaperRow>& rows);

}  // namespace tubetrack::bench
