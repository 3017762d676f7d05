#pragma once

#include <Driver/OniDriverAPI.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <vector>

#include "cable.hpp"
#include "faults.hpp"
#include "recording_player.hpp"

namespace tubetrack {

/// Both units OpenNI2 has, the one nearer to the recording's first: a program that doesn't ask gets that. Then the same
/// with every second row and column alone, where the size is even.
std::vector<OniVideoMode> modes_of(const StreamInfo& info);

/// The virtual device's one stream: answers what real drivers answer (mode, field of view, mirroring, cropping, …) and
/// sends what a RecordingPlayer plays.
class VirtualStream final : public oni::driver::StreamBase {
 public:
  /// `faults` and `cable` belong to the driver, which outlives its streams.
  VirtualStream(PlayerSettings settings, const StreamInfo& info, Faults& faults, Cable& cable);
  ~VirtualStream() override;

  OniStatus start() override;
  void stop() override;
  OniBool isPropertySupported(int id) override;
  OniStatus getProperty(int id, void* data, int* size) override;
  OniStatus setProperty(int id, const void* data, int size) override;

 private:
  OutputFormat output_format() const;
  OniStatus set_mode(const OniVideoMode& wanted);
  OniStatus set_cropping(const OniCropping& wanted);
  void send(const DepthFrame& frame, bool cut);

  PlayerSettings settings_;
  StreamInfo info_;
  Faults& faults_;
  Cable& cable_;
  std::mutex mutex_;
  OniVideoMode mode_;
  OniBool mirrored_ = TRUE;  // as PrimeSense's driver: a program that forgets to switch it off shall notice here
  OniCropping cropping_{};
  /// A program that asks a started stream for anything has come back from the runtime's `start`.
  std::atomic<bool> asked_since_start_ = false;
  std::unique_ptr<RecordingPlayer> player_;
};

}  // namespace tubetrack
