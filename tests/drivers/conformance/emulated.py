"""What the benches of the conformance kit share whose devices are emulators with a port."""

import shutil


class Emulated:
    """device: the emulator. folder: of its port's file."""

    def __init__(self, device, folder):
        self.device, self.folder = device, folder

    @property
    def silence(self):
        return self.device.silence

    @silence.setter
    def silence(self, on):
        self.device.silence = on

    @property
    def connected(self):
        return self.device.connected

    async def unplug(self):
        self.device.unplug()

    async def replug(self):
        self.device.replug()

    async def close(self):
        self.device.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def send(self, data):
        if self.device._port is not None:
            self.device._port.send(data)

    def hold(self):
        self.device.stall()

    def release(self):
        self.device.release()
