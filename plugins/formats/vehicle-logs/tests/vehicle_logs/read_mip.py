"""Prints each valid value of a log of MIP as MSCL reads it from a port: one line with the name of its
channel and the value."""

import socket
import sys
import threading
import time

import mscl

data = open(sys.argv[1], "rb").read()
server = socket.socket()
server.bind(("127.0.0.1", 0))
server.listen(1)
ended = threading.Event()


def serve():
    connection, _ = server.accept()
    connection.sendall(data)
    ended.wait()
    connection.close()


threading.Thread(target=serve, daemon=True).start()
node = mscl.InertialNode(mscl.Connection.TcpIp("127.0.0.1", server.getsockname()[1]))
quiet = 0
while quiet < 5:
    packets = node.getDataPackets(200)
    quiet = 0 if packets else quiet + 1
    for packet in packets:
        for point in packet.data():
            # numbers of 32 and 64 bits as they are
            if point.valid():
                kind = point.storedAs()
                number = point.as_double() if kind == mscl.valueType_double else point.as_float()
                print(point.channelName(), repr(float(number)))
ended.set()
