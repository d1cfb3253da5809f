#include "server/storage/image_name.h"

#include "core/base/checksum.h"

namespace glasswing {

std::string image_name(std::string_view bytes) {
  return image_name_of(checksum_of(bytes));
}

std::string image_name_of(std::string checksum) {
  std::erase(checksum, ':');
  return checksum;
}

}  // namespace glasswing
