#include "client/client.h"

int main(int argc, char** argv) {
  return glasswing::run_client(argc, argv);
}
