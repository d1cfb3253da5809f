// A matte as a script of Nuke: a graph of its stock nodes that shows the object in front of any picture.
//
//   C = F + sum over modes and taps k of R q_k B(c + h_k d; s),    B(x; s): the picture, blurred by s px^2
//
// Footprints are sums of round ones: s is the smaller variance, or the larger over 1 + kMaxSpread^2 if that
// is more, and five taps along the longer axis make up the rest. B is a ladder of blurs, each the previous
// one averaged with itself, moved by whole pixels; two neighbours are mixed by s. STMaps take single pixels
// of it (filter Impulse), three times as many as the monitor's each way, so that their own, undocumented
// filtering does not matter. Wide blurs need fewer: the ladder has three bands, and each uses every third or
// ninth pixel of the previous one.
//
// It relies on what the Foundry's Reference Guide says about Read, Remove, Reformat, Crop, Transform, Merge,
// Copy, STMap, Expression, MergeExpression and ColorMatrix, and the layers' names that its example
// ExrChannelNameToNuke makes from a file's. That STMap's input 0 is the source, and its result as large as
// the map, the guide does not say; existing scripts assume it.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

namespace glasswing {

struct NukeScript {
  std::string text;
  int node_count = 0;
};

// `matte`: the bytes of its file; `file`: how the script is to name that file. Boxes are shown as Gaussians
// of the same covariance. INVALID_ARGUMENT: `file` has a character that Nuke would interpret; errors of
// decode_matte() and PrimaryMix::create().
absl::StatusOr<NukeScript> nuke_script(std::string_view matte, const std::string& file);

}  // namespace glasswing
