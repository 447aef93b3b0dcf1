/* Framing of messages: COBS, a version, a CRC. */
#include "messages.h"

#include <string.h>

enum { HEAD = 2, CHECK = 2, RUN = 255 };

unsigned kmpc_crc16(const unsigned char *bytes, int count)
{
    unsigned crc = 0;
    for (int i = 0; i < count; i++) {
        crc ^= (unsigned)bytes[i] << 8;
        for (int bit = 0; bit < 8; bit++)
            crc = (crc & 0x8000u ? (crc << 1) ^ 0x1021u : crc << 1) & 0xffffu;
    }
    return crc;
}

/* Put the zeros of a frame back in place; how many bytes it has, or -1 if it is none. */
static int restored(unsigned char *frame, int length)
{
    int to = 0;
    for (int from = 0; from < length;) {
        const int run = frame[from++];
        if (from + run - 1 > length)
            return -1;
        for (int i = 1; i < run; i++)
            frame[to++] = frame[from++];
        if (run < RUN && from < length)
            frame[to++] = 0;
    }
    return to;
}

int kmpc_decode(struct kmpc_decoder *decoder, unsigned char byte)
{
    if (byte) {
        if (decoder->length >= 0 && decoder->length < KMPC_FRAME)
            decoder->frame[decoder->length++] = byte;
        else
            decoder->length = -1;
        return 0;
    }
    const int length = decoder->length;
    decoder->length = 0;
    if (!length) /* zeros between frames */
        return 0;
    const int count = length < 0 ? -1 : restored(decoder->frame, length);
    const int body = count - CHECK;
    if (body < HEAD || decoder->frame[0] != KMPC_PROTOCOL ||
        kmpc_crc16(decoder->frame, body) !=
            (((unsigned)decoder->frame[body] << 8) | decoder->frame[body + 1])) {
        decoder->bad++;
        return 0;
    }
    decoder->good++;
    decoder->size = body - HEAD;
    return decoder->frame[1];
}

const unsigned char *kmpc_payload(const struct kmpc_decoder *decoder)
{
    return decoder->frame + HEAD;
}

int kmpc_encode(int kind, const unsigned char *payload, int size, unsigned char *frame)
{
    unsigned char body[HEAD + KMPC_PAYLOAD + CHECK];
    body[0] = KMPC_PROTOCOL;
    body[1] = (unsigned char)kind;
    if (size)
        memcpy(body + HEAD, payload, (size_t)size);
    const unsigned crc = kmpc_crc16(body, HEAD + size);
    body[HEAD + size] = (unsigned char)(crc >> 8);
    body[HEAD + size + 1] = (unsigned char)crc;
    int at = 0, to = 1;
    for (int i = 0; i < HEAD + size + CHECK; i++) {
        if (to - at == RUN) {
            frame[at] = RUN;
            at = to++;
        }
        if (body[i]) {
            frame[to++] = body[i];
        } else {
            frame[at] = (unsigned char)(to - at);
            at = to++;
        }
    }
    frame[at] = (unsigned char)(to - at);
    frame[to++] = 0;
    return to;
}

uint32_t kmpc_get(const unsigned char *from, int bytes)
{
    uint32_t value = 0;
    while (bytes--)
        value = (value << 8) | from[bytes];
    return value;
}

float kmpc_get_float(const unsigned char *from)
{
    const uint32_t bits = kmpc_get(from, 4);
    float value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

unsigned char *kmpc_put(unsigned char *to, uint32_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        *to++ = (unsigned char)(value >> (8 * i));
    return to;
}

unsigned char *kmpc_put_float(unsigned char *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof(bits));
    return kmpc_put(to, bits, 4);
}
