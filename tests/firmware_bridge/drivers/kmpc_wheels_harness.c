/* Reads records: milliseconds, length (4 + 2 bytes, little-endian) and bytes; writes the answers. */
#include "kmpc_wheels.h"
#include <string.h>

int main(void) {
  struct kmpc_wheels wheels;
  memset(&wheels, 0, sizeof wheels);
  unsigned char head[6];
  char reply[KMPC_LONGEST_REPLY];
  while (fread(head, 1, sizeof head, stdin) == sizeof head) {
    uint32_t now = head[0] | (uint32_t)head[1] << 8;
    now |= (uint32_t)head[2] << 16 | (uint32_t)head[3] << 24;
    int length = head[4] | head[5] << 8;
    kmpc_check(&wheels, now);
    for (int i = 0; i < length; i++) {
      int byte = getchar();
      if (byte == EOF) return 1;
      int size = kmpc_feed(&wheels, (char)byte, now, reply);
      if (size > 0) fwrite(reply, 1, (size_t)size, stdout);
    }
    /* like the motors of the test: they do at once what they are told, for one second a record */
    for (int i = 0; i < KMPC_MOTORS; i++) wheels.speed[i] = wheels.driven ? wheels.target[i] : 0;
    fflush(stdout);
  }
  return 0;
}
