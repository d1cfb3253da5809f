// Detects disturbances of the rig during a capture. Every two seconds or so a picture whose frame is already
// stored is shown again, alternately with vertical and horizontal edges. Any difference between the two
// frames is due to the rig, whatever the plan shows and whatever is on the stage.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "glasswing/v1/camera_service.pb.h"
#include "glasswing/v1/session.pb.h"
#include "server/capture/capture_setup.h"

namespace glasswing {

// Used by the capture's thread only.
class RigWatch {
 public:
  // `setup` is borrowed; it must be complete when steps are shown. `by_hand`: a person moves the object,
  // never exactly to the same place twice.
  RigWatch(const CaptureSetup& setup, bool by_hand) : setup_(setup), by_hand_(by_hand) {}

  // Repeated pictures have their own numbers, beyond those of steps.
  static bool is_repeat(int number) { return number >= kFirstRepeat; }
  // The steps of one stage and exposure as they are to be shown: with repeated pictures between them and at
  // their end. `proven`: the steps that have a frame, and are shown for other cameras. The watches of cameras
  // that are shown the same steps repeat the same pictures under the same numbers.
  std::vector<Step> with_repeats(const std::vector<Step>& steps, int hold_refreshes,
                                 const std::set<int>& proven);

  struct Comparison {
    int repeat = 0;  // its number
    v1::FrameComparison frames;
  };
  // What these frames of repeated pictures are compared with. Pictures without a frame so far are left out.
  std::vector<Comparison> comparisons(const std::vector<v1::Frame>& repeats,
                                      const std::set<int>& proven) const;
  // Takes a comparison's result, at this time of the capture, s. True: changes() has changed.
  bool add(int repeat, const v1::FrameChange& change, double seconds);
  // What has happened since this watch began, oldest first.
  std::vector<v1::RigChange> changes(const std::string& session) const;

 private:
  static constexpr int kFirstRepeat = 1 << 20;
  static constexpr size_t kRight = 0, kDown = 1, kGain = 2, kOffset = 3, kQuantities = 4;
  using Quantities = std::array<double, kQuantities>;  // px, px, 1, of the reference's range of light
  static constexpr Quantities kAtFirst{0.0, 0.0, 1.0, 0.0};

  struct Repeat {
    int step = 0;      // whose picture it is
    size_t place = 0;  // in order_: how many steps were shown before it
    bool object = false;
    double exposure_ms = 0.0;
  };
  // How a stage at one exposure was last seen. Places are indices into order_.
  struct Seen {
    Quantities level = kAtFirst, last = kAtFirst;
    std::array<size_t, kQuantities> place{};
    bool known = false;
  };
  struct Change {
    bool of_place = false;  // else of light
    bool slow = false;
    Quantities by{};
    size_t good = 0, bad = 0;    // the last place where all was well, and the first where it was not
    std::optional<size_t> over;  // where all was well again
    bool object = false;
    double seconds = 0.0;
  };

  std::optional<int> picture(const Step& of_group, bool upright) const;
  bool note(Change change, bool back);
  v1::RigChange told(const Change& change, const std::string& session) const;
  void tell_place(const Change& change, const std::string& session, v1::RigChange& told) const;
  void tell_light(const Change& change, const std::string& session, v1::RigChange& told) const;
  // Marks the steps at these places as lost; also the patch-learning steps, if the camera now sees the patch
  // elsewhere.
  void lose(size_t first, size_t last, bool patches, v1::RigChange& told) const;
  std::string steps_text(size_t first, size_t last) const;

  const CaptureSetup& setup_;
  const bool by_hand_;
  std::vector<int> order_;       // steps as they are shown, after those that were proven at first
  std::vector<Repeat> repeats_;  // by number - kFirstRepeat
  std::map<std::pair<bool, double>, Seen> seen_;  // by stage and exposure
  std::vector<Change> changes_;
  size_t newest_ = 0;  // place of the newest comparison
};

}  // namespace glasswing
